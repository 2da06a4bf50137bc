"""The bus of a machine file: which one is opened and locked for whom, and left when something fails; by hand."""

from __future__ import annotations

import cmath
import hashlib
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.od.facts import DriveFacts, ObjectFact
from gantryctl.drives.od.object_table import read_objects_of
from gantryctl.drives.profiles import load_profile
from gantryctl.drives.profiles.dictionary import profile_of_table
from gantryctl.errors import DeviceError
from gantryctl.image import DriveState
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.wiring import canopen, simulator, teeth, virtual, virtual_nodes
from gantryctl.wiring.bus_log import log_in_force, logged_links
from gantryctl.wiring.canopen import can_link, canopen_drive, read_only_drive, reset_drive_fault
from gantryctl.wiring.engine import build_program
from gantryctl.wiring.program import speed_step_deg_s
from gantryctl.wiring.virtual import as_in_table, drive_hardware, drive_kind
from support.modulo_machine import modulo_machine

REAL = {"can.interface": "socketcan", "can.channel": "can7", "can.node": 5, "can.master_node": 9}


@pytest.fixture(scope="module")
def can() -> Machine:
    return load_machine(configs_folder() / "hust_can.toml")


class Bench:
    """Every part of a link that would need hardware, with what was asked of it."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        self.locks: list[str] = []
        self.buses: list[tuple[object, ...]] = []
        self.links: list[dict[str, Any]] = []
        self.counted: list[str] = []
        self.released = self.closed = 0
        self.fails: BaseException | None = None
        patch.setattr(canopen, "DriveLock", self._lock)
        patch.setattr(canopen, "open_bus", self._bus)
        patch.setattr(canopen, "BusLink", self._link)
        patch.setattr(canopen, "InterfaceCounters", self._counters)
        patch.setattr(canopen, "link_log", lambda channel, *, virtual: ("log", channel, virtual))

    def _lock(self, where: str) -> SimpleNamespace:
        self.locks.append(where)

        def release() -> None:
            self.released += 1

        return SimpleNamespace(release=release)

    def _bus(self, *given: object) -> str:
        if self.fails is not None:
            raise self.fails
        self.buses.append(given)
        return "bus"

    def _link(self, bus: str, **given: Any) -> SimpleNamespace:
        self.links.append(given)

        def close() -> None:
            self.closed += 1
            given["when_closed"]()

        return SimpleNamespace(bus=bus, close=close)

    def _counters(self, channel: str) -> str:
        self.counted.append(channel)
        return f"counters of {channel}"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(monkeypatch)


def test_the_bus_of_the_file_is_opened_locked_for_its_node_until_the_link_is_closed(
    can: Machine, bench: Bench
) -> None:
    link: Any = can_link(with_values(can, {**REAL, "can.bitrate": 500_000}))
    assert bench.locks == ["socketcan can7, node 5"]
    assert bench.buses == [("socketcan", "can7", 500_000)]
    (given,) = bench.links
    assert given["log"] == ("log", "can7", False)
    assert given["counters"] == "counters of can7"
    assert bench.released == 0
    link.close()
    assert bench.released == 1


def test_only_an_interface_of_the_kernel_has_counters(can: Machine, bench: Bench) -> None:
    can_link(with_values(can, {"can.interface": "pcan", "can.channel": "PCAN_USBBUS1"}))
    assert bench.links[-1]["counters"] is None
    assert bench.counted == []
    # Without a channel the interface has one of its own.
    can_link(with_values(can, {"can.interface": "pcan", "can.channel": ""}))
    assert bench.buses[-1][:2] == ("pcan", None)
    assert bench.links[-1]["log"] == ("log", "pcan", False)


@pytest.mark.parametrize("fails", [DeviceError("no can7"), KeyboardInterrupt()])
def test_a_bus_that_does_not_open_is_not_locked(can: Machine, bench: Bench, fails: BaseException) -> None:
    bench.fails = fails
    with pytest.raises(type(fails)):
        can_link(with_values(can, REAL))
    assert bench.released == 1


def test_a_plant_that_is_not_there_leaves_the_bus(
    can: Machine, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def nobody(_: Machine) -> None:
        raise DeviceError("nobody listens")

    monkeypatch.setattr(virtual, "remote_plant", nobody)
    with pytest.raises(DeviceError, match="nobody listens"):
        canopen_drive(
            with_values(can, {**REAL, "can.side_channel": "/nothing", "can.commissioning_required": False})
        )
    assert (bench.closed, bench.released) == (1, 1)


@pytest.mark.parametrize("fails", [False, True])
def test_a_reset_goes_to_the_drive_and_leaves_the_bus(
    can: Machine, bench: Bench, monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    asked: list[tuple[int, int]] = []

    def node(_: object, node_id: int, master: int, __: float) -> str:
        asked.append((node_id, master))
        return "the drive"

    def reset(found: str) -> DriveState:
        assert found == "the drive"
        if fails:
            raise DeviceError("no answer")
        return DriveState.SWITCH_ON_DISABLED

    monkeypatch.setattr("gantryctl.drives.canopen.bus.node.RemoteNode", node)
    monkeypatch.setattr("gantryctl.drives.canopen.setup.fault_reset.reset_fault", reset)
    machine = with_values(can, REAL)
    if fails:
        with pytest.raises(DeviceError, match="no answer"):
            reset_drive_fault(machine)
    else:
        assert reset_drive_fault(machine) is DriveState.SWITCH_ON_DISABLED
    assert asked == [(5, 9)]
    assert bench.closed == 1


def test_who_only_reads_leaves_the_bus(can: Machine, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        "gantryctl.drives.canopen.setup.read_only.ReadOnlyDrive", lambda _, settings: settings.node
    )
    read: Any = read_only_drive(with_values(can, REAL))
    assert (read, bench.closed) == (5, 1)


# --- a virtual drive ----------------------------------------------------------------------------------


def test_a_virtual_drive_stands_where_it_is_told_also_at_0_deg(
    can: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(can.axis), "start_angle_deg", 30.0)
    assert drive_hardware(can).start_angle_rad == pytest.approx(0.5235988)
    assert drive_hardware(can, 0.0).start_angle_rad == 0.0


def test_a_virtual_drive_of_the_file_has_the_quirks_that_are_asked_for_too(can: Machine) -> None:
    machine = with_values(can, {"can.virtual_drive": "lagging+rpm"})
    assert drive_kind(machine, ["slow-save"]).name == "lagging+rpm+slow-save"
    assert drive_kind(machine).name == "lagging+rpm"


def test_a_drive_of_the_field_has_its_plate_its_modes_and_its_units(can: Machine) -> None:
    table = read_objects_of(virtual.shipped_objects(), "maxon EPOS4 0x1018")
    made, profile = as_in_table(drive_kind(can), table, can), profile_of_table(table)
    assert profile is not None
    assert (0x1018, 1, profile.match.vendor) in made.defaults
    # No mode, and those of the profile that a virtual drive has.
    assert made.modes[0] == 0
    assert set(made.modes) - {0} <= set(profile.modes)
    assert (made.ramp_unit, made.ramp_size) == (profile.units.ramp, profile.units.ramp_size)
    assert made.counts_per_turn == can.can.increments_per_turn


@pytest.mark.parametrize(("word", "unit"), [(None, "mrev/s"), (0x00B4_4700, "r/min")])
def test_a_drive_of_the_field_is_believed_before_its_profile(
    can: Machine, word: int | None, unit: str
) -> None:
    """60A9 of the drive says r/min, the profile mrev/s."""
    table = read_objects_of(virtual.shipped_objects(), "Ingenia EVE-NET 1.8.1")
    entries = {place: entry for place, entry in table.entries.items() if place != (0x60A9, 0)}
    if word is not None:
        entries[0x60A9, 0] = replace(table.entries[0x60FF, 0], default=word)
    made = as_in_table(drive_kind(can), replace(table, entries=entries), can)
    assert made.velocity_unit == unit


def test_what_a_virtual_drive_and_its_master_send_is_logged_with_its_own_time(can: Machine) -> None:
    heard: list[tuple[float, int, bool]] = []
    log: Any = SimpleNamespace(
        link=lambda channel, *, virtual: (
            lambda time_s, can_id, data, sent: heard.append((time_s, can_id, sent))
        )
    )
    with logged_links(log):
        link, drive, _ = virtual.virtual_bus(can)
        link.pause(0.25)
        at_s = drive.time_us * 1e-6
        link.send(0x80, b"")
        link.close()
    assert at_s == pytest.approx(0.25)
    # SYNC lets a scan of 4 ms go by.
    assert [time_s for time_s, can_id, sent in heard if (can_id, sent) == (0x80, True)] == [
        pytest.approx(at_s, abs=0.004)
    ]


def test_the_log_in_force_hears_of_a_virtual_link_that_it_is_one(can: Machine) -> None:
    """Its frames have the time of the drive, not that of a clock."""
    asked: list[tuple[str, bool]] = []
    log: Any = SimpleNamespace(link=lambda channel, *, virtual: asked.append((channel, virtual)))
    assert log_in_force() is None
    with logged_links(log):
        assert log_in_force() is log
        virtual.virtual_bus(can)[0].close()
    assert log_in_force() is None
    assert asked == [("simulated", True)]


@pytest.mark.parametrize("reaction", [2, 6])
def test_the_checksum_of_a_drive_is_that_of_the_values_that_count(can: Machine, reaction: int) -> None:
    """605A says how a quick stop ends; 1008 is a name."""
    objects = {(0x605A, 0): ObjectFact(True, False, reaction), (0x1008, 0): ObjectFact(False, False, "drive")}
    found = canopen.parameter_checksum(can, DriveFacts(0, 0, 0, 0, "", objects))
    assert found == hashlib.sha256(f"605A:00={reaction}".encode()).hexdigest()


def test_the_time_of_a_virtual_drive_is_that_of_whoever_waits(can: Machine) -> None:
    link, drive, _ = virtual.virtual_bus(can)
    begun_us = drive.time_us
    link.pause(0.02)
    assert drive.time_us - begun_us == 20_000
    link.close()


@pytest.mark.parametrize(("unit", "told"), [("mrev/s", False), ("inc/s", True), ("profile", False)])
def test_a_unit_of_the_file_against_the_profile_of_the_drive_is_told(
    can: Machine, unit: str, told: bool
) -> None:
    """Profile ingenia_everest has mrev/s: with another one every speed is wrong by a factor."""
    machine = with_values(can, {"can.velocity_unit": unit, "can.profile": "ingenia_everest"})
    vendor = load_profile("ingenia_everest").match.vendor
    found = canopen.contradictions(machine, DriveFacts(vendor, 0, 0, 0, "", {}))
    assert [each.object for each in found] == (["[can] velocity_unit"] if told else [])


def test_a_speed_whose_unit_nobody_knows_counts_no_increments(
    can: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Unknown:
        velocity_unit, profile = "r/min", None

        @property
        def speed_in_increments(self) -> bool:
            raise DeviceError("no unit")

    for settings, counts in (
        (Unknown(), False),
        (SimpleNamespace(velocity_unit=None, profile=None, speed_in_increments=True), False),
        (SimpleNamespace(velocity_unit="inc/s", profile=None, speed_in_increments=True), True),
    ):
        made: Any = SimpleNamespace(of_drive=lambda _, found=settings: found)
        monkeypatch.setattr(canopen, "canopen_settings", lambda _, made=made: made)
        assert canopen.counts_increments(can, None) is counts  # type: ignore[arg-type]


def test_the_state_of_a_virtual_axis_without_ends_is_turned_back(
    can: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Kept angles do not grow from run to run: their last bits would be lost."""
    link, drive, _ = virtual.virtual_bus(can)
    kept = drive.plant_state()
    link.close()
    seen: list[Any] = []
    monkeypatch.setattr(
        virtual, "turned_back", lambda machine, state: (seen.append((machine, state)), kept)[1]
    )
    link, drive, _ = virtual.virtual_bus(can, state={"pos_load": 1e6})
    link.close()
    assert seen == [(can, {"pos_load": 1e6})]
    assert drive.plant_state() == kept


def test_a_virtual_node_has_its_own_wiring(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bits of its own inputs and outputs, not those of the drive beside it."""
    made: list[tuple[Any, ...]] = []
    monkeypatch.setattr(virtual_nodes, "IoNode", lambda *given, **_: made.append(given))
    bits: Any = lambda **given: SimpleNamespace(model_dump=lambda: given)  # noqa: E731
    io = SimpleNamespace(node=3, inputs=bits(estop_ok=4, door_ok=-1), outputs=bits(brake_open=6, watchdog=-1))
    source = SimpleNamespace(source="none")
    machine: Any = SimpleNamespace(
        can=SimpleNamespace(io=io, inputs=bits(estop_ok=1), outputs=bits(brake_open=2), load_encoder=source)
    )
    drive: Any = SimpleNamespace(
        plant=SimpleNamespace(cabinet="cabinet"),
        wires="wires",
        stepped=True,
        hardware=SimpleNamespace(load_encoder=None),
    )
    send: Any = "send"
    virtual_nodes.virtual_neighbours(machine, drive, send)
    assert made == [(3, "send", "cabinet", "wires", {"estop_ok": 4}, {"brake_open": 6})]


@pytest.mark.parametrize(("source", "made"), [("none", False), ("60E4", False), ("node", True)])
def test_only_an_encoder_that_is_a_node_has_a_node(
    monkeypatch: pytest.MonkeyPatch, source: str, made: bool
) -> None:
    monkeypatch.setattr(virtual_nodes, "EncoderNode", lambda *given, **_: given[0])
    encoder = SimpleNamespace(source=source, node=4)
    machine: Any = SimpleNamespace(can=SimpleNamespace(io=SimpleNamespace(node=0), load_encoder=encoder))
    ring = SimpleNamespace(counts=None)
    plant = SimpleNamespace(ring_counts=None)
    drive: Any = SimpleNamespace(plant=plant, stepped=True, hardware=SimpleNamespace(load_encoder=ring))
    send: Any = None
    assert tuple(virtual_nodes.virtual_neighbours(machine, drive, send)) == (None, 4 if made else None)


@pytest.mark.parametrize(
    ("unit", "increments", "step_deg_s"),
    # One r/min of the motor; one increment in a scan of 4 ms: 0.25 turns a second; 1144 turns are one of the gantry.
    [("r/min", 524_288, 6.0 / 1144.0), ("inc/s", 1000, 90.0 / 1144.0)],
)
def test_the_smallest_speed_is_a_unit_of_the_bus_or_an_increment_in_a_scan(
    can: Machine, unit: str, increments: int, step_deg_s: float
) -> None:
    changes = {"velocity_unit": unit, "increments_per_turn": increments}
    machine = can.model_copy(
        update={
            "can": can.can.model_copy(update=changes),
            "control": can.control.model_copy(update={"scan_period_ms": 4.0}),
        }
    )
    assert speed_step_deg_s(machine) == pytest.approx(step_deg_s)


# --- a simulated drive --------------------------------------------------------------------------------


def test_an_encoder_is_on_the_simulated_ring_where_the_file_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    fitted: list[bool] = []
    monkeypatch.setattr(simulator, "fit_load_encoder", lambda machine, _: fitted.append(True))
    for there in (False, True):
        simulator.gantry_sim(with_values(default_machine(), {"plant.load_encoder.fitted": there}))
        assert fitted == [True] * there


def test_the_encoder_on_the_simulated_ring_has_the_steps_noise_and_latency_of_the_file() -> None:
    """20 bits are 5.9921e-6 rad a step; 40 us."""
    encoder = {"bits": 20, "noise_rad": 2e-6, "latency_us": 40.0, "scale_error_rad": 3e-5}
    machine = with_values(
        default_machine(), {f"plant.load_encoder.{key}": each for key, each in encoder.items()}
    )
    got: list[Any] = []
    sim: Any = SimpleNamespace(fit_load_encoder=lambda *given: got.extend(given))
    simulator.fit_load_encoder(machine, sim)
    step_rad, noise_rad, latency_s, scale = got
    assert (step_rad, noise_rad, latency_s) == pytest.approx((5.9921e-6, 2e-6, 40e-6), rel=1e-4)
    assert max(abs(gain) for _, gain, _ in scale) <= 3e-5


def test_pitch_deviations_are_those_of_iso_1328() -> None:
    """Module 4 mm, 100 mm, in um: 0.3 x 4 + 1.25 x 10 + 7, and 0.3 x (4 + 0.4 x 10) + 4; twice that two grades on."""
    for grade, factor in ((5.0, 1.0), (7.0, 2.0)):
        assert teeth.pitch_deviation_um(4.0, 100.0, grade) == pytest.approx(20.7 * factor)
        assert teeth.single_pitch_um(4.0, 100.0, grade) == pytest.approx(6.4 * factor)


def test_drawn_teeth_leave_the_long_waves_to_other_keys() -> None:
    """Twelve waves of a turn of the ring, one of the pinion."""
    for drawn, without in ((teeth.ring_deviations_um, 12), (teeth.pinion_deviations_um, 1)):
        found = drawn(60, 5.0, 6.0, 7)
        sizes = [
            abs(sum(each * cmath.exp(2j * math.pi * wave * k / 60) for k, each in enumerate(found)))
            for wave in range(without + 2)
        ]
        assert max(sizes[: without + 1]) < 1e-9 < sizes[-1]


def test_drawn_teeth_are_the_worst_of_their_grade() -> None:
    """Module 5 mm, 300 mm, grade 6: the largest step is (0.3 (5 + 0.4 sqrt 300) + 4) sqrt 2 = 10.7176 um."""
    found = teeth.ring_deviations_um(60, 5.0, 6.0, 8)
    assert max(abs(found[k] - found[k - 1]) for k in range(60)) == pytest.approx(10.717562)


def test_an_ideal_axis_goes_on_where_it_was() -> None:
    """0.5 rad are 0.5 x 1144 / 2 pi turns of the motor from the middle of its range."""
    machine = with_values(default_machine(), {"drive.kind": "ideal"})
    per_rad = 1144.0 * machine.counts_per_turn / math.tau
    middle = machine.encoder.turns * machine.counts_per_turn / 2.0
    for drive, at_rad in (
        (simulator.ideal_drive(machine, 30.0), 0.5235988),
        (simulator.ideal_drive(machine, 30.0, {"pos_ideal": 0.5}), 0.5),
    ):
        assert drive.read().pos_act_counts - middle == pytest.approx(at_rad * per_rad, rel=1e-6)


@pytest.mark.parametrize("side", ["roller", "motor"])
def test_without_coulomb_friction_there_is_no_friction(side: str) -> None:
    """The element divides by it."""
    for coulomb_nm, there in ((5.0, True), (0.0, False)):
        changes = {f"plant.{side}_friction.{name}_nm": coulomb_nm for name in ("coulomb", "breakaway")}
        found = simulator.plant_params(with_values(default_machine(), changes))
        assert getattr(found, f"{side}_friction") is there


def test_both_motors_of_an_axis_without_ends_are_turned_back() -> None:
    """Two turns of the axis are 2 x 1144 of each motor; what each of them is off by stays."""
    machine, turns = modulo_machine(), 2.0 * math.tau
    state = {
        "pos_load": turns + 0.1, "pos_motor": 1144 * turns + 114.0, "pos_motor_2": 1144 * turns + 115.0,
        "drive_pos_last": 1144 * turns + 114.5, "count_offset": 7.0,
    }  # fmt: skip
    found = simulator.turned_back(machine, state)
    expected = {"pos_load": 0.1, "pos_motor": 114.0, "pos_motor_2": 115.0, "drive_pos_last": 114.5}
    assert {name: found[name] for name in expected} == pytest.approx(expected, abs=1e-8)


def test_a_state_without_an_angle_is_turned_back_by_nothing() -> None:
    machine = modulo_machine()
    for state in ({"pos_load": math.nan, "count_offset": 1.0}, {"count_offset": 1.0}):
        assert simulator.turned_back(machine, state)["count_offset"] == 1.0


def test_plans_are_kept_only_where_they_are_asked_for() -> None:
    machine = default_machine()
    drive = simulator.sim_drive(machine)
    plain = build_program(machine, drive).axis
    assert not plain.virtual.keep_plans
    # Nothing is known of a load that was never held.
    assert plain.settings.power.holding_torque_nm == 0.0
    assert build_program(machine, drive, keep_plans=True).axis.virtual.keep_plans
