"""Parameters of a drive by hand: each object as CiA 301 and CiA 402 have it, what differs, and what is written."""

from __future__ import annotations

import pytest

from gantryctl.drives.canopen.settings import (
    OutputBits,
    drive_identity,
)
from gantryctl.drives.canopen.setup import parameter_check as check
from gantryctl.drives.canopen.setup.opening import (
    wanted_of,
)
from gantryctl.drives.canopen.setup.parameter_watch import ROUND_S, ParameterWatch
from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.profiles import load_profile
from gantryctl.errors import DeviceError
from unit.drives.canopen.dictionary import READ_ONLY, CountedSync, Dictionary, Place, settings
from unit.drives.canopen.wire import Asked

pytestmark = pytest.mark.can


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
