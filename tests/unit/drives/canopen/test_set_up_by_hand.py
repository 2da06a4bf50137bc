"""Set-up of a drive by hand: each parameter and mapping object as CiA 301 and CiA 402 have it, and what differs."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gantryctl.drives.canopen import mapping as m
from gantryctl.drives.canopen.bus.node import NodeIdentity
from gantryctl.drives.canopen.bus.sdo import SdoError
from gantryctl.drives.canopen.nodes.bus_node import BusNode, NodeObject, communication_objects
from gantryctl.drives.canopen.nodes.io_node import IoNode
from gantryctl.drives.canopen.settings import (
    CanopenSettings,
    InputBits,
    IoNodeSettings,
    OutputBits,
    drive_identity,
)
from gantryctl.drives.canopen.setup import parameter_check as check
from gantryctl.drives.canopen.setup.fault_reset import reset_fault
from gantryctl.drives.canopen.setup.live_facts import read_facts
from gantryctl.drives.canopen.setup.opening import (
    RESTART_MARKERS,
    _outputs_off,
    _select_csv,
    read_restart_marker,
    wanted_of,
    write_restart_marker,
)
from gantryctl.drives.canopen.setup.parameter_watch import ROUND_S, ParameterWatch
from gantryctl.drives.canopen.setup.parameters import refuse_energised, restore
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.profiles import load_profile
from gantryctl.errors import CommandRefused, DeviceError
from gantryctl.image import DriveState
from gantryctl.wiring.canopen import canopen_settings
from unit.drives.canopen.canopen_bench import machine
from unit.drives.canopen.wire import Asked, Wire, remote_node

pytestmark = pytest.mark.can

Place = tuple[int, int]
READ_ONLY, MISSING = 0x0601_0002, 0x0602_0000


class Dictionary:
    """An object dictionary in memory that stands for `SdoClient`.

    Attributes:
        written: (index, sub, value) in their order.
        fixed: objects that take a write and keep their value. refused: abort codes by object.
    """

    def __init__(self, values: dict[Place, int], sizes: dict[int, int] | None = None) -> None:
        self.values, self._sizes = dict(values), sizes or {}
        self.written: list[tuple[int, int, int]] = []
        self.fixed: set[Place] = set()
        self.refused: dict[Place, int] = {}

    def number(self, index: int, sub: int = 0) -> int:
        if (index, sub) not in self.values:
            raise SdoError(index, sub, MISSING)
        return self.values[index, sub]

    def optional(self, index: int, sub: int = 0) -> int | None:
        return self.values.get((index, sub))

    def read(self, index: int, sub: int) -> bytes:
        return self.number(index, sub).to_bytes(self._sizes.get(index, 4), "little")

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        if (index, sub) in self.refused:
            raise SdoError(index, sub, self.refused[index, sub])
        self.written.append((index, sub, value))
        if (index, sub) not in self.fixed:
            self.values[index, sub] = value

    def write(self, index: int, sub: int, data: bytes) -> None:
        self.set(index, sub, int.from_bytes(data, "little"))

    def text(self, index: int) -> str:
        return ""


def settings(**changes: object) -> CanopenSettings:
    return replace(canopen_settings(machine()), **changes)  # type: ignore[arg-type]


# --- parameters ---------------------------------------------------------------------------------------------------

# 5.4 deg/s2 at the gantry are 17.16 turns/s2 of the motor, 6.5 deg/s 1239.3 r/min; 385 of 257 N m are 1498 per mille.
WANTED = {
    (0x60A9, 0): 0x00B5_0300, (0x1005, 0): 0x80, (0x1019, 0): 0, (0x1006, 0): 4000, (0x1007, 0): 0, (0x60C2, 1): 4,
    (0x60C2, 2): -3,
    (0x1014, 0): 0x82, (0x1017, 0): 50, (0x1016, 1): 0x007F_0096, (0x1400, 5): 50, (0x6007, 0): 1, (0x605E, 0): 2,
    (0x605A, 0): 2, (0x605B, 0): 1, (0x605C, 0): 1, (0x605D, 0): 1, (0x1029, 1): 0, (0x6085, 0): 8_996_782,
    (0x6080, 0): 1239, (0x6072, 0): 1498, (0x6076, 0): 257_000, (0x6502, 0): 0x100, (0x608F, 1): 524_288,
    (0x608F, 2): 1,
}  # fmt: skip


def wanted(rated: int | None = None, **changes: object) -> dict[Place, int]:
    return {(p.obj, p.sub): p.value for p in wanted_of(settings(**changes), rated)}


@pytest.mark.parametrize(
    ("changes", "rated", "others"),
    [
        ({}, None, {}),
        ({}, 257_000, {}),
        # 1000 means twice the rated torque; 6076 says 300 N m.
        ({"torque_reference": 2.0}, None, {(0x6072, 0): 749}),
        ({}, 300_000, {(0x6072, 0): 1283}),
        # A controller that closes the brake wants the drive to hold meanwhile.
        ({"brake_owner": "object_60FE"}, None, {(0x605A, 0): 6}),
        ({"brake_owner": "controller_output"}, None, {(0x605A, 0): 6}),
        ({"watched_alone": True}, None, {(0x1016, 1): 0x007F_0064}),
        # 17.16 turns/s2 are 1029.6 r/min a second.
        ({"velocity_unit": "r/min"}, None, {(0x60A9, 0): 0x00B4_4700, (0x6085, 0): 1030}),
    ],
)
def test_every_parameter(changes: dict[str, object], rated: int | None, others: dict[Place, int]) -> None:
    assert wanted(rated, **changes) == WANTED | others


@pytest.mark.parametrize(("profile", "ramp"), [("copley", 899_678), ("maxon_epos4", 1030)])
def test_the_ramp_in_the_unit_of_the_maker(profile: str, ramp: int) -> None:
    """Tens of increments/s2, and r/min a second whatever the unit of the speed is."""
    found = wanted(velocity_unit="0.1 r/min", profile=load_profile(profile))
    assert found[0x6085, 0] == ramp


@pytest.mark.parametrize(
    ("profile", "who"),
    [("", "no profile fits this drive"), ("festo_cmmt", "profile festo_cmmt has none")],
)
def test_a_speed_in_no_known_unit_is_never_commanded(profile: str, who: str) -> None:
    given = settings(velocity_unit=None, profile=load_profile(profile) if profile else None)
    with pytest.raises(DeviceError, match=f"the unit of 60FF is not known.*{who}"):
        _ = given.speed_per_rad_s


@pytest.mark.parametrize("place", [place for place in WANTED if place != (0x6076, 0)])
def test_a_parameter_that_is_otherwise_differs(place: Place) -> None:
    (parameter,) = [p for p in wanted_of(settings(), None) if (p.obj, p.sub) == place]
    assert check.compare(parameter, WANTED[place]).verdict.refuses is False
    # Speed ceiling and torque limit may be rounded by one.
    apart = 2 if place in ((0x6080, 0), (0x6072, 0)) else 1
    bad = {(0x6502, 0): 0xFF, (0x1005, 0): 0x81}.get(place, WANTED[place] + apart)
    assert check.compare(parameter, bad).verdict.refuses
    # Without 1019 a drive expects no counter.
    missing = V.OK if place == (0x1019, 0) else V.ABSENT
    assert check.compare(parameter, None).verdict is missing


@pytest.mark.parametrize(
    ("rated", "ok"),
    [
        (257_000, True),
        (128_500, True),
        (128_499, False),
        (385_500, True),
        (385_501, False),
        (0, False),
        (257, False),
    ],
)
def test_a_rated_torque_may_be_half_as_large_or_half_as_large_again(rated: int, ok: bool) -> None:
    """257 N m in mN m; torque limit and torque reading are parts of it."""
    assert check.compare(check.rated_torque(settings()), rated).verdict.refuses is not ok


@pytest.mark.parametrize(("turns", "shown"), [(1, 1), (4096, 4096), (8192, 8192), (65_536, 8192)])
def test_turns_that_32_bits_do_not_hold_are_not_on_the_bus(turns: int, shown: int) -> None:
    """2^19 increments in a turn leave 2^13 turns."""
    found = drive_identity(settings(turns=turns), "drive", "A-B-7")
    assert (found.counts_per_turn, found.turns) == (524_288, shown)


@pytest.mark.parametrize(
    ("owner", "outputs", "by_60fe", "mask"),
    [
        ("drive", OutputBits(), False, 0), ("drive", OutputBits(horn=3), False, 8),
        ("object_60FE", OutputBits(), True, 1), ("object_60FE", OutputBits(lamp=4), True, 0x11),
        ("controller_output", OutputBits(), False, 0),
        ("controller_output", OutputBits(brake_release=16), True, 1 << 16),
    ],
)  # fmt: skip
def test_a_brake_at_an_output_of_the_drive_is_worked_by_its_word(
    owner: str, outputs: OutputBits, by_60fe: bool, mask: int
) -> None:
    """Bit 0 of 60FE is the brake of CiA 402, or a bit that the machine file names."""
    found = settings(brake_owner=owner, outputs=outputs)
    assert (found.brake_by_60fe, found.output_mask) == (by_60fe, mask)


@pytest.mark.parametrize(
    ("period_s", "beats", "missed"), [(0.001, 50, 150), (0.004, 12, 38), (0.010, 5, 15), (0.1, 1, 2)]
)
def test_heartbeats_by_scans(period_s: float, beats: int, missed: int) -> None:
    """Ours every 50 ms, the drive's within 150 ms; one a scan at the most, and two that are missed at the least."""
    for found in (
        settings(period_s=period_s),
        # Of a drive that watches ours alone ours is missed sooner; its own is not.
        settings(period_s=period_s, watched_alone=True, lone_heartbeat_s=0.06),
    ):
        assert (found.heartbeat_scans, found.timeout_scans) == (beats, missed)


V = check.ParameterVerdict


@pytest.mark.parametrize(
    ("place", "fact", "verdict", "after"),
    [
        # 6007 = 1 is written.
        ((0x6007, 0), None, V.ABSENT, None), ((0x6007, 0), ObjectFact(True, False, 1), V.OK, 1),
        ((0x6007, 0), ObjectFact(False, False, 1), V.OK, 1), ((0x6007, 0), ObjectFact(True, False, 0), V.DIFFERS, 1),
        ((0x6007, 0), ObjectFact(False, False, 0), V.FIXED, 0),
        ((0x6007, 0), ObjectFact(True, False, 0, high=0), V.FIXED, 0),
        ((0x6007, 0), ObjectFact(True, False, 3, low=2), V.FIXED, 3),
        ((0x6007, 0), ObjectFact(True, False), V.UNKNOWN, 1), ((0x6007, 0), ObjectFact(False, False), V.UNKNOWN, None),
        # Speed ceiling of 1239 r/min, and torque limit: a value within the rounding stays.
        ((0x6080, 0), ObjectFact(True, False, 1240), V.OK, 1240),
        ((0x6080, 0), ObjectFact(True, False, 1241), V.DIFFERS, 1239),
        # Increments and rated torque are only compared: the maker's tool writes them, so a default is no promise.
        ((0x608F, 1), ObjectFact(True, False, 524_288), V.OK, None),
        ((0x608F, 1), ObjectFact(True, False, 1), V.DIFFERS, None),
        ((0x608F, 1), ObjectFact(False, False, 1), V.DIFFERS, 1),
        ((0x6076, 0), ObjectFact(False, False, 1), V.DIFFERS, None),
        # What modes a drive has nobody writes.
        ((0x6502, 0), ObjectFact(True, False, 0xFF), V.DIFFERS, 0xFF),
        ((0x6502, 0), ObjectFact(False, False, 0x1FF), V.OK, 0x1FF),
    ],
)  # fmt: skip
def test_what_a_drive_has_and_what_its_set_up_leaves(
    place: Place, fact: ObjectFact | None, verdict: check.ParameterVerdict, after: int | None
) -> None:
    facts = DriveFacts(1, 2, 3, 4, "", {} if fact is None else {place: fact})
    (parameter,) = [p for p in wanted_of(settings(), None) if (p.obj, p.sub) == place]
    (row,) = check.compare_parameters(facts, [parameter])
    assert row.verdict is verdict
    assert check.as_set_up(facts, [parameter]).value(*place) == after


@pytest.mark.parametrize(
    ("place", "shown"),
    [((0x1016, 1), "node 127, 150 ms"), ((0x1005, 0), "80h"), ((0x6502, 0), "100h"),
     ((0x60A9, 0), "B50300h"), ((0x6072, 0), "1498")],
)  # fmt: skip
def test_a_row_shows_its_value_as_a_manual_does(place: Place, shown: str) -> None:
    (parameter,) = [p for p in wanted_of(settings(), None) if (p.obj, p.sub) == place]
    row = check.compare(parameter, parameter.value)
    assert (row.want, row.have) == (shown, shown)


def test_a_row_says_why_the_drive_did_not_take_its_value() -> None:
    quick, shutdown = (p for p in wanted_of(settings(), None) if p.obj in (0x605A, 0x605B))
    rows = (check.compare(quick, 6), check.compare(quick, 2), check.compare(shutdown, 0))
    told = check.with_abort_codes(rows, {"605A:00": READ_ONLY})
    assert told[0].line == (
        "605A:00 Quick stop option code: want 2, have 6 · quick stop ramps down, closes the brake, then takes the "
        "torque off · writing it: cannot be written (abort code 06010002)"
    )
    assert told[1:] == rows[1:]


@pytest.mark.parametrize(
    ("held", "verdict"),
    [
        (0x82, V.OK), (0x4000_0082, V.OK), (0x8000_0082, V.DIFFERS),
        (0x83, V.DIFFERS), (0x2000_0082, V.DIFFERS), (0, V.DIFFERS),
    ],
)  # fmt: skip
def test_a_drive_is_heard_by_its_own_emergency_identifier(held: int, verdict: check.ParameterVerdict) -> None:
    """Node 2: 082h, which is valid and has 11 bits; bit 30 means nothing (CiA 301)."""
    (emcy,) = (p for p in wanted_of(settings(), None) if p.obj == 0x1014)
    row = check.compare(emcy, held)
    assert (row.verdict, row.want) == (verdict, "82h")


def test_what_scales_a_torque_or_a_speed_is_part_of_the_checksum() -> None:
    """Name plate of the motor, limits of current, gear, feed, motor type, profile velocity, polarity, what is set."""
    plate = {
        (0x6075, 0), (0x6076, 0), (0x6073, 0), (0x6091, 1), (0x6091, 2), (0x6092, 1), (0x6092, 2), (0x6402, 0),
        (0x607F, 0), (0x607E, 0),
    }  # fmt: skip
    wanted_places = [p for p in wanted_of(settings(), None) if p.obj in (0x6007, 0x6080)]
    assert set(check.set_value_places(wanted_places)) == plate | {(0x6007, 0), (0x6080, 0)}

    def checksum(values: dict[Place, int]) -> str:
        held = {place: ObjectFact(True, False, value) for place, value in values.items()}
        return check.parameter_checksum(DriveFacts(1, 2, 3, 4, "", held), wanted_places)

    held = dict.fromkeys((*plate, (0x6007, 0)), 7)
    changed = [held | {place: 8} for place in held] + [{p: 7 for p in held if p != gone} for gone in held]
    assert len({checksum(each) for each in (held, *changed)}) == 2 * len(held) + 1
    assert checksum(held | {(0x1000, 0): 1}) == checksum(held)


def test_what_a_drive_takes_no_value_for_is_known() -> None:
    """Cannot be written, or out of range, is never; not now, or for no reason, is no property of the drive."""
    parameters = wanted_of(settings(), None)
    compared = {(p.obj, p.sub) for p in parameters if not p.writable}
    assert compared == {(0x60A9, 0), (0x6502, 0), (0x608F, 1), (0x608F, 2), (0x6076, 0)}
    sdo = Dictionary({(p.obj, p.sub): 0 for p in parameters})
    sdo.refused = {(0x605A, 0): READ_ONLY, (0x6085, 0): 0x0609_0031, (0x6007, 0): 0x0800_0022}
    sdo.refused |= {(0x605E, 0): 0x0800_0000, (0x605B, 0): 0x0604_0043}
    del sdo.values[0x605D, 0]
    refused, codes = check.write_parameters(sdo, parameters)  # type: ignore[arg-type]
    assert refused == {(0x605A, 0), (0x6085, 0)}
    assert codes == {
        "605A:00": READ_ONLY, "6085:00": 0x0609_0031, "6007:00": 0x0800_0022, "605E:00": 0x0800_0000,
        "605B:00": 0x0604_0043,
    }  # fmt: skip
    # What is right already is not written, what only the maker's tool writes neither.
    assert {(i, s) for i, s, _ in sdo.written} == {
        (p.obj, p.sub) for p in parameters if p.writable and p.value
    } - set(sdo.refused) - {(0x605D, 0)}


class CountedSync(Dictionary):
    """A drive whose counter of SYNC changes while it has no period, and then alone (CiA 301)."""

    def set(self, index: int, sub: int, value: int, size: int | None = None) -> None:
        if index == 0x1019 and self.values.get((0x1006, 0)):
            raise SdoError(index, sub, 0x0800_0022)
        super().set(index, sub, value, size)


@pytest.mark.parametrize("period_us", [4000, 10_000, 0])
def test_the_counter_of_sync_is_taken_out_while_there_is_no_period(period_us: int) -> None:
    parameters = wanted_of(settings(), None)
    sdo = CountedSync(
        {(p.obj, p.sub): p.value for p in parameters} | {(0x1019, 0): 10, (0x1006, 0): period_us}
    )
    assert check.write_parameters(sdo, parameters) == (frozenset(), {})  # type: ignore[arg-type]
    assert (sdo.values[0x1019, 0], sdo.values[0x1006, 0]) == (0, 4000)
    stopped = [(0x1006, 0, 0)] if period_us else []
    assert sdo.written == [*stopped, (0x1019, 0, 0), (0x1006, 0, 4000)]


def test_a_counter_of_sync_that_stays_is_fixed_and_the_period_comes_back() -> None:
    parameters = wanted_of(settings(), None)
    sdo = Dictionary({(p.obj, p.sub): p.value for p in parameters} | {(0x1019, 0): 10})
    sdo.refused = {(0x1019, 0): READ_ONLY}
    refused, codes = check.write_parameters(sdo, parameters)  # type: ignore[arg-type]
    assert (refused, codes) == ({(0x1019, 0)}, {"1019:00": READ_ONLY})
    assert sdo.values[0x1006, 0] == 4000


def test_every_parameter_is_read_again_in_a_round() -> None:
    asked, parameters = Asked(), wanted_of(settings(), None)
    watch = ParameterWatch(asked, parameters, 0.004)  # type: ignore[arg-type]
    for _ in range(round(ROUND_S / 0.004) + len(parameters)):
        watch.scan(1)
    assert asked.reads[: len(parameters)] == list(WANTED)
    assert len(parameters) <= len(asked.reads) <= len(parameters) + 1


def test_the_code_of_a_fault_is_asked_for_once() -> None:
    asked = Asked()
    watch = ParameterWatch(asked, wanted_of(settings(), None), 0.004)  # type: ignore[arg-type]
    for unknown in (False, True, True, True):
        watch.scan(1, unknown)
    assert asked.reads == [(0x603F, 0)]
    asked.then(bytes.fromhex("10 23"))
    assert watch.error_code == 0x2310
    watch.scan(1, False)
    assert watch.error_code == 0
    watch.scan(1, True)
    assert asked.reads == [(0x603F, 0)] * 2


def test_a_difference_is_told_until_it_is_right_again_and_a_refusal_is_one() -> None:
    asked = Asked()
    watch = ParameterWatch(asked, [p for p in wanted_of(settings(), None) if p.obj == 0x6007], 0.004)  # type: ignore[arg-type]
    for data, line in ((b"\1\0", False), (b"\0\0", True), (b"\1\0", False), (None, True), (b"\1\0", False)):
        watch.scan(1_000_000)
        asked.then(data)
        assert bool(watch.line) is line
    assert set(asked.reads) == {(0x6007, 0)}


# --- mapping ------------------------------------------------------------------------------------------------------

PLAN = m.plan_mapping(frozenset((m.TORQUE_OFFSET, m.VELOCITY, m.TORQUE, m.INPUTS)), outputs=True)
# Identifiers of CiA 301 for node 2; bit 30: no remote request. Entries: index, sub-index, bits.
MAPPED = {
    (0x1400, 1): 0x202, (0x1400, 2): 1, (0x1600, 0): 3, (0x1600, 1): 0x6040_0010, (0x1600, 2): 0x60FF_0020,
    (0x1600, 3): 0x60B2_0010,
    (0x1401, 1): 0x302, (0x1401, 2): 1, (0x1601, 0): 1, (0x1601, 1): 0x60FE_0120,
    (0x1800, 1): 0x4000_0182, (0x1800, 2): 1, (0x1A00, 0): 3, (0x1A00, 1): 0x6041_0010, (0x1A00, 2): 0x6064_0020,
    (0x1A00, 3): 0x6077_0010,
    (0x1801, 1): 0x4000_0282, (0x1801, 2): 1, (0x1A01, 0): 2, (0x1A01, 1): 0x606C_0020, (0x1A01, 2): 0x60FD_0020,
}  # fmt: skip
UNUSED = {
    (0x1402, 1): 0x402, (0x1403, 1): 0x8000_0502, (0x1802, 1): 0x4000_0382, (0x1803, 1): 0xC000_0482,
}  # fmt: skip


def test_the_mapping_is_written_the_cia_way() -> None:
    """Telegram invalid, count 0, entries, count, type, telegram valid; what is not used is switched off."""
    sdo = Dictionary(UNUSED)
    assert m.write_mapping(sdo, 2, PLAN) is None  # type: ignore[arg-type]
    assert sdo.values == MAPPED | {place: value | 0x8000_0000 for place, value in UNUSED.items()}
    for first in (0x1400, 0x1800):
        steps = [(i, s, v) for i, s, v in sdo.written if i in (first, first + 0x200)]
        assert steps[0] == (first, 1, MAPPED[first, 1] | 0x8000_0000)
        assert steps[1] == (first + 0x200, 0, 0)
        assert steps[-3:] == [(first + 0x200, 0, 3), (first, 2, 1), (first, 1, MAPPED[first, 1])]


@pytest.mark.parametrize("place", MAPPED)
def test_a_mapping_that_reads_back_otherwise_is_refused(place: Place) -> None:
    m.check_mapping(Dictionary(MAPPED), 2, PLAN)  # type: ignore[arg-type]
    for bad in (
        MAPPED[place] ^ 0x10,
        MAPPED[place] | 0x8000_0000 if place[1] == 1 and place[0] % 0x200 < 4 else 0,
    ):
        if bad != MAPPED[place]:
            with pytest.raises(DeviceError, match=f"{place[0]:04X}:{place[1]:02X}"):
                m.check_mapping(Dictionary(MAPPED | {place: bad}), 2, PLAN)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", [254, 255])
def test_a_fixed_type_is_good_for_commands_and_not_for_feedback(kind: int) -> None:
    sdo = Dictionary({**UNUSED, (0x1400, 2): kind})
    sdo.refused[0x1400, 2] = READ_ONLY
    assert m.write_mapping(sdo, 2, PLAN) is None  # type: ignore[arg-type]
    m.check_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]
    sdo = Dictionary({**UNUSED, (0x1800, 2): kind})
    sdo.refused[0x1800, 2] = READ_ONLY
    with pytest.raises(SdoError):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]
    with pytest.raises(DeviceError, match="1800:02"):
        m.check_mapping(Dictionary(MAPPED | {(0x1800, 2): kind}), 2, PLAN)  # type: ignore[arg-type]
    sdo = Dictionary({**UNUSED, (0x1400, 2): 10})  # every tenth SYNC
    sdo.refused[0x1400, 2] = READ_ONLY
    with pytest.raises(SdoError):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]


def test_a_drive_that_falls_silent_in_an_entry_has_not_refused_it() -> None:
    sdo = Dictionary(UNUSED)
    sdo.refused[0x1600, 2] = 0x0504_0000
    with pytest.raises(SdoError, match="no answer"):
        m.write_mapping(sdo, 2, PLAN)  # type: ignore[arg-type]


@pytest.mark.parametrize(("masks", "written"), [({}, []), ({(0x60FE, 2): 0}, [(0x60FE, 2, 0x0001_0001)])])
def test_all_outputs_are_off_and_the_brake_is_set_before_the_telegrams_fly(
    masks: dict[Place, int], written: list[tuple[int, int, int]]
) -> None:
    """Bit 0 of 60FE sets the brake; not every drive has a mask (60FE:02)."""
    node = remote_node(Wire())
    node.sdo = Dictionary(masks)  # type: ignore[assignment]
    _outputs_off(node, 0x0001_0001)
    assert node.sdo.written == [*written, (0x60FE, 1, 1)]  # type: ignore[attr-defined]


def test_an_object_of_another_type_is_there_and_its_value_means_nothing() -> None:
    """6041 with four bytes, where the standard has two; silence is no answer."""
    sdo = Dictionary({(0x6041, 0): 0x40, (0x6061, 0): 9}, {0x6061: 1})
    who = NodeIdentity(1, 2, 3, 4, 402, "", "", "")
    facts = read_facts(sdo, who, ((0x6041, 0), (0x6061, 0), (0x606C, 0)))  # type: ignore[arg-type]
    assert (facts.has(0x6041), facts.value(0x6041), facts.value(0x6061), facts.has(0x606C)) == (
        True,
        None,
        9,
        False,
    )


def test_an_object_of_another_size_is_not_mapped() -> None:
    """60B2 has 32 bits in one real drive: it would push what stands behind it out of the telegram."""
    sizes = {0x60B2: 4, 0x606C: 4, 0x6077: 2, 0x60FD: 4, 0x603F: 2}
    sdo = Dictionary({**UNUSED, **{(obj, 0): 0 for obj in sizes}}, sizes)
    found = m.configure(sdo, 2, False)  # type: ignore[arg-type]
    assert m.TORQUE_OFFSET not in found.signals
    assert found.refused == {m.TORQUE_OFFSET}
    assert [signal.obj for signal in found.rpdos[0].signals] == [0x6040, 0x60FF]


# --- mode, marker, fault, backup ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("shown", "lines"), [(9, 0), (8, 1), (0, 1), (-1, 1)])
def test_only_a_drive_that_shows_csv_is_let_go(shown: int, lines: int) -> None:
    node = remote_node(Wire())
    node.sdo = Dictionary({(0x6060, 0): 8, (0x6061, 0): shown})  # type: ignore[assignment]
    assert len(_select_csv(node) or ()) == lines
    assert node.sdo.written[-1] == (0x6060, 0, 9)


class LateMode(Dictionary):
    """A drive that shows what it is to do only as it is asked for the fifth time."""

    asked = 0

    def number(self, index: int, sub: int = 0) -> int:
        self.asked += index == 0x6061
        return 9 if index == 0x6061 and self.asked >= 5 else super().number(index, sub)


def test_a_drive_may_show_csv_a_few_readings_later() -> None:
    node = remote_node(Wire())
    node.sdo = LateMode({(0x6060, 0): 8, (0x6061, 0): 8})  # type: ignore[assignment]
    assert _select_csv(node) == ()


@pytest.mark.parametrize(
    ("held", "marker"),
    [
        (0x8000_0200, 0x200),
        (0x0000_0200, None),
        (0x8000_0502, None),
        (0x8000_0180, None),
        (0x8000_03FF, 0x3FF),
    ],
)
def test_the_marker_is_the_identifier_of_a_telegram_that_is_off(held: int, marker: int | None) -> None:
    assert (RESTART_MARKERS.start, RESTART_MARKERS.stop) == (0x181, 0x400)
    assert read_restart_marker(Dictionary({(0x1403, 1): held})) == marker  # type: ignore[arg-type]


def test_a_marker_counts_when_the_drive_has_kept_it() -> None:
    keeps = Dictionary({(0x1403, 1): 0x8000_0502})
    assert write_restart_marker(keeps, 2, 0x200)  # type: ignore[arg-type]
    assert keeps.values[0x1403, 1] == 0x8000_0200
    assert write_restart_marker(keeps, 2, None)  # type: ignore[arg-type]
    assert keeps.values[0x1403, 1] == 0x8000_0502
    forgets = Dictionary({(0x1403, 1): 0x8000_0502})
    forgets.fixed.add((0x1403, 1))
    assert not write_restart_marker(forgets, 2, 0x200)  # type: ignore[arg-type]
    in_use = Dictionary({(0x1403, 1): 0x0000_0502})
    assert not write_restart_marker(in_use, 2, 0x200)  # type: ignore[arg-type]
    assert not in_use.written


@pytest.mark.parametrize(
    ("word", "on"),
    [(0x27, True), (0x07, True), (0x0F, True), (0x40, False), (0x21, False), (0x23, False), (0x08, False)],
)
def test_parameters_wait_while_there_is_torque(word: int, on: bool) -> None:
    node = remote_node(Wire())
    node.sdo = Dictionary({(0x6041, 0): word})  # type: ignore[assignment]
    if on:
        with pytest.raises(CommandRefused, match="parameters wait"):
            refuse_energised(node)
    else:
        refuse_energised(node)


def drive_of(values: dict[Place, int]) -> tuple[object, Dictionary]:
    node = remote_node(Wire())
    plate = {(0x1000, 0): 402, (0x1018, 1): 0x11, (0x1018, 2): 0x22, (0x1018, 3): 0, (0x1018, 4): 7}
    sdo = Dictionary({(0x6041, 0): 0x40, **plate, **values})
    node.sdo = sdo  # type: ignore[assignment]
    return node, sdo


def test_a_backup_is_written_to_the_same_model_and_compared() -> None:
    node, sdo = drive_of({(0x6085, 0): 1, (0x6086, 0): 0})
    sdo.fixed.add((0x6086, 0))
    kept = {"drive": "00000011-00000022-8", "values": {"6085:00": "0a000000", "6086:00": "01000000"}}
    wrong = restore(node, kept)  # type: ignore[arg-type]
    assert [line[:7] for line in wrong] == ["6086:00"]
    assert sdo.values[0x6085, 0] == 10
    for other in ("00000011-00000023-7", "00000012-00000022-7"):
        node, sdo = drive_of({(0x6085, 0): 1})
        with pytest.raises(CommandRefused, match="another kind of drive"):
            restore(node, {**kept, "drive": other})  # type: ignore[arg-type]
        assert not sdo.written


def test_a_fault_is_reset_by_an_edge_that_enables_nothing() -> None:
    node, sdo = drive_of({(0x6041, 0): 0x08})
    assert reset_fault(node) is DriveState.FAULT  # type: ignore[arg-type]
    assert sdo.written == [(0x6040, 0, 0x00), (0x6040, 0, 0x80), (0x6040, 0, 0x00)]


# --- nodes beside the drive ---------------------------------------------------------------------------------------

# 16 outputs and 10 inputs; by CiA 401 and decision 0012: FFh in 6206 takes the error value, which is 0 in 6207.
IO_OBJECTS = {
    (0x1005, 0): 0x80, (0x1019, 0): 0, (0x1006, 0): 4000, (0x1007, 0): 0, (0x1016, 1): 0x007F_0096, (0x1017, 0): 50,
    (0x1029, 1): 0, (0x1400, 5): 50,
    (0x6002, 1): 0, (0x6002, 2): 0,
    (0x6202, 1): 0, (0x6206, 1): 0xFF, (0x6207, 1): 0, (0x6202, 2): 0, (0x6206, 2): 0xFF, (0x6207, 2): 0,
}  # fmt: skip
NEEDED = {(0x1016, 1), (0x6206, 1), (0x6206, 2), (0x6207, 1), (0x6207, 2)}
NOTHING = InputBits(*[None] * len(InputBits._fields))


@pytest.mark.parametrize(
    ("outputs", "holds"),
    [
        (OutputBits(brake_release=8), True), (OutputBits(watchdog=8), True), (OutputBits(drive_enable=8), True),
        (OutputBits(horn=8, lamp=0, in_position=1, at_rest=2), False),
    ],
)  # fmt: skip
def test_what_an_io_node_must_have(outputs: OutputBits, holds: bool) -> None:
    io = IoNode(
        remote_node(Wire()),
        settings(),
        IoNodeSettings(3, NOTHING._replace(brake_open=9), outputs),
        lambda: True,
    )
    found = {(row.obj, row.sub): row for row in io.node._objects}
    wanted = IO_OBJECTS if holds else {place: v for place, v in IO_OBJECTS.items() if place != (0x1400, 5)}
    assert {place: row.value for place, row in found.items()} == wanted
    assert {place for place, row in found.items() if row.needed} == (NEEDED if holds else set())


def test_a_node_that_keeps_another_value_is_refused() -> None:
    remote = remote_node(Wire())
    row = NodeObject(0x6206, 1, 1, 0xFF, "outputs take their error values", needed=True)
    node = BusNode(
        remote, settings(), "I/O", m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),)), (row,), lambda: True
    )
    for fixed, refused in ((False, False), (True, True)):
        remote.sdo = sdo = Dictionary({(0x6206, 1): 0}, {0x6206: 1})  # type: ignore[assignment]
        sdo.fixed = {(0x6206, 1)} if fixed else set()
        if refused:
            with pytest.raises(DeviceError, match="6206:01 is 0h, written FFh"):
                node._holds(row)
        else:
            assert node._holds(row)
    remote.sdo = Dictionary({})  # type: ignore[assignment]
    with pytest.raises(DeviceError, match="6206:01"):
        node._holds(row)
    assert not node._holds(row._replace(needed=False))


@pytest.mark.parametrize(
    ("place", "held", "refused"),
    [
        ((0x1005, 0), 0x81, True), ((0x1007, 0), 2000, True), ((0x1019, 0), 10, True),
        # What keeps none of its telegrams from counting; what is right, or is not there.
        ((0x1006, 0), 0, False), ((0x1029, 1), 1, False), ((0x1007, 0), 0, False), ((0x1007, 0), None, False),
    ],
)  # fmt: skip
def test_a_node_whose_telegrams_would_not_count_is_refused(
    place: Place, held: int | None, refused: bool
) -> None:
    """Read-only, with another value than it must have."""
    rows = {(row.obj, row.sub): row for row in communication_objects(settings(), False)}
    remote = remote_node(Wire())
    mapping = m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),))
    node = BusNode(remote, settings(), "I/O", mapping, rows.values(), lambda: True)
    remote.sdo = sdo = Dictionary({} if held is None else {place: held})  # type: ignore[assignment]
    sdo.refused = {place: READ_ONLY}
    if refused:
        with pytest.raises(DeviceError, match=rows[place].meaning):
            node._holds(rows[place])
    else:
        assert node._holds(rows[place]) is (held == rows[place].value)


def test_a_node_takes_sync_without_a_counter_before_it_gets_the_period() -> None:
    remote, rows = remote_node(Wire()), communication_objects(settings(), False)
    mapping = m.Mapping((), (m.Pdo(0, (m.STATUSWORD,)),))
    node = BusNode(remote, settings(), "I/O", mapping, rows, lambda: True)
    remote.sdo = sdo = CountedSync({(0x1019, 0): 10, (0x1006, 0): 4000}, {0x1019: 1})  # type: ignore[assignment]
    assert [row.obj for row in rows if node._holds(row)] == [0x1019, 0x1006]
    assert sdo.written == [(0x1006, 0, 0), (0x1019, 0, 0), (0x1006, 0, 4000)]
