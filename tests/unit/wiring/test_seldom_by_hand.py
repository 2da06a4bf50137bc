"""What a machine file seldom says on its way to program, drive and plant: each figure by hand."""

from __future__ import annotations

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.canopen.bus.link import ECHOING
from gantryctl.drives.od.facts import DriveFacts
from gantryctl.drives.od.object_table import read_objects_of
from gantryctl.drives.profiles.dictionary import profile_of_table
from gantryctl.errors import ConfigError
from gantryctl.image import DriveIdentity, DriveRequest, InputImage, OperatorCommand
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.program import GantryProgram
from gantryctl.runtime import FixedOperator, ScanFailure
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.units import deg, rad
from gantryctl.wiring import canopen, compensation, engine, simulator, virtual, virtual_nodes
from gantryctl.wiring.calibration_watch import calibration_watch
from gantryctl.wiring.plant_effects import larger_share_nm, ring_teeth
from gantryctl.wiring.program import axis_settings, ramps_deg, travel_settings
from gantryctl.wiring.virtual import as_in_table, drive_kind
from support.delivered_axes import axis_of
from support.improved import improved_machine
from support.modulo_machine import modulo_machine

approx = pytest.approx
MACHINE = default_machine()
IDEAL = with_values(MACHINE, {"drive.kind": "ideal"})
BUS = load_machine(configs_folder() / "hust_can.toml")
WITH_NODES = load_machine(configs_folder() / "hust_can_nodes.toml")


# --- program ----------------------------------------------------------------------------------------------------------


def test_the_way_ahead_of_a_sector_is_that_of_the_highest_setting_at_the_most() -> None:
    """4 scans of 4 ms; k = (1/5.39 - 1/5.4)/2 = 1.7179e-4 s2/deg is largest at 46.6 deg/s: 6 x 0.016 - 36 k."""
    changes = {
        "axis.no_go_deg": [[40.0, 50.0]], "virtual_axis.jog_release_dec_deg_s2": 5.39,
        "control.scan_period_ms": 4.0,
    }  # fmt: skip
    found = travel_settings(with_values(MACHINE, changes))
    assert deg(found.no_go_clearance_rad) == approx(0.06 + 0.0898156, abs=1e-6)


def test_a_drive_without_a_plant_may_stand_still_and_change_its_speed_at_once() -> None:
    found = axis_settings(IDEAL).monitors
    assert found.encoder_still_time_s == math.inf
    assert (found.speed_change_max_rad_s2, found.speed_change_per_torque) == (math.inf, math.inf)
    assert axis_settings(MACHINE).monitors.encoder_still_time_s == 0.25


@pytest.mark.parametrize(
    ("changes", "longer_deg"),
    [
        # From the whole deceleration on: 0.15 deg/s2 at 0.1 instead of 0.4 deg/s3 take 1.125 s longer, at 0.1125 deg/s.
        ({"dec_deg_s2": 0.15, "end_dec_deg_s2": 0.2, "end_jerk_deg_s3": 0.1}, 0.1265625),
        # An end that is harder than the move takes nothing away.
        ({"end_dec_deg_s2": 0.2, "end_jerk_deg_s3": 0.5}, 0.0),
    ],
)
def test_a_gentle_end_begins_at_the_deceleration_and_never_shortens_a_move(
    changes: dict[str, float], longer_deg: float
) -> None:
    base = {"virtual_axis.profile": "jerk_limited", "virtual_axis.jerk_deg_s3": 0.4}
    plain = with_values(MACHINE, base | {f"virtual_axis.{key}": value for key, value in changes.items()})
    gentle = with_values(plain, {"virtual_axis.gentle_end": True})
    assert ramps_deg(gentle, 3.0) - ramps_deg(plain, 3.0) == approx(longer_deg)


# --- engine -----------------------------------------------------------------------------------------------------------


def test_a_program_without_a_plant_needs_no_calibration() -> None:
    machine = with_values(improved_machine(), {"drive.kind": "ideal"}).calibrated(None)
    identity = DriveIdentity("drive", "IDEAL", 4_194_304, 4096)
    drive: Any = SimpleNamespace(identity=lambda: identity, torque_preload=True)
    assert engine.build_program(machine, drive, zero_counts=7.0).axis.zero_counts == 7.0


@pytest.mark.parametrize(
    ("observes", "tells", "fits"), [(True, True, True), (True, False, False), (False, False, True)]
)
def test_only_an_observer_of_the_moment_needs_the_torque_of_the_motor(
    observes: bool, tells: bool, fits: bool
) -> None:
    machine = with_values(improved_machine(), {"control.compensation.moment_observer.active": observes})
    identity = DriveIdentity("drive", "SIM-0001", 4_194_304, 4096)
    drive: Any = SimpleNamespace(identity=lambda: identity, torque_preload=True, reports_torque=tells)
    if fits:
        assert engine.build_program(machine, drive, zero_counts=7.0).axis.zero_counts == 7.0
    else:
        with pytest.raises(ConfigError, match="lives on the torque of the motor"):
            engine.build_program(machine, drive, zero_counts=7.0)


def test_a_virtual_drive_goes_on_from_its_state_at_the_angle_that_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(canopen, "canopen_drive", lambda *given: given)
    state = {"pos_load": 0.5}
    made: Any = engine.drive_of(BUS, 12.0, state)
    assert made == (BUS, 12.0, state)


def test_what_a_recorder_says_itself_stands_above_what_the_machine_says() -> None:
    made = engine._recorder(
        MACHINE, lambda columns: MemoryRecorder(columns, {"machine": "mine"}), ("time_s",)
    )
    assert isinstance(made, MemoryRecorder)
    assert (made.metadata["machine"], made.metadata["period_s"]) == ("mine", 0.001)


# --- bus --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stepped", [True, False])
@pytest.mark.parametrize("interface", ["socketcan", "udp_multicast", "pcan"])
def test_a_link_knows_whether_its_bus_echoes_and_its_drive_waits(
    monkeypatch: pytest.MonkeyPatch, interface: str, stepped: bool
) -> None:
    """An echo that is not expected would be heard as a second controller."""
    made: dict[str, Any] = {}
    monkeypatch.setattr(canopen, "DriveLock", lambda _: SimpleNamespace(release=None))
    monkeypatch.setattr(canopen, "open_bus", lambda *_: "bus")
    monkeypatch.setattr(canopen, "InterfaceCounters", lambda _: None)
    monkeypatch.setattr(canopen, "BusLink", lambda _, **given: made.update(given))
    keys = {"can.interface": interface, "can.stepped": stepped, "can.commissioning_required": False}
    canopen.can_link(with_values(BUS, keys))
    assert ECHOING == ("udp_multicast", "socketcan")
    assert (made["echoes"], made["stepped"]) == (interface != "pcan", stepped)


def test_a_virtual_drive_has_the_quirks_state_and_angle_that_are_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    seen: list[tuple[Any, ...]] = []
    monkeypatch.setattr(virtual, "virtual_node", lambda *given: (seen.append(given), ("link", "plant"))[1])
    opened: Any = lambda *given: SimpleNamespace(open=lambda: given)  # noqa: E731
    monkeypatch.setattr(canopen, "CanopenDrive", opened)
    made: Any = canopen.canopen_drive(BUS, 12.0, {"pos_load": 0.5}, ["lagging"])
    assert seen == [(BUS, 12.0, {"pos_load": 0.5}, ["lagging"])]
    assert (made[0], made[2]) == ("link", "plant")


def test_a_drive_has_the_profile_that_it_fits_where_the_file_names_none() -> None:
    """Vendor 668 has one profile."""
    found = canopen.profile_of_drive(BUS, DriveFacts(668, 0, 0, 0, "", {}))
    assert found is not None
    assert found.name == "ingenia_everest"
    assert canopen.profile_of_drive(BUS, DriveFacts(0x7FFF_FFFF, 0, 0, 0, "", {})) is None


def test_parameters_of_a_drive_are_told_apart_by_their_sub_index() -> None:
    """The scan period stands in 60C2 as 4 and a power of ten."""
    found = canopen.parameters_of(BUS, DriveFacts(0, 0, 0, 0, "", {}))
    assert {"60C2:01", "60C2:02", "6085:00"} <= set(found)
    assert all(place == row.place for place, row in found.items())


# --- virtual drive ----------------------------------------------------------------------------------------------------


def test_a_drive_of_the_field_takes_the_modes_that_are_simulated_and_keeps_its_quirks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of its profile's modes none, profile velocity and CSV; its own unit of the rated torque, here 10 mN m."""
    table = read_objects_of(virtual.shipped_objects(), "maxon EPOS4 0x1018")
    profile = profile_of_table(table)
    assert profile is not None
    units = profile.units.model_copy(update={"rated_torque_per_nm": 100.0})
    other = profile.model_copy(update={"units": units, "modes": (1, 3, 8, 9)})
    monkeypatch.setattr(virtual, "profile_of_table", lambda _: other)
    made = as_in_table(drive_kind(MACHINE, ["dangerous-defaults"]), table, MACHINE)
    assert made.modes == (0, 3, 9)
    assert made.rated_torque_per_nm == 100.0
    assert made.defaults == ((0x6007, 0, 0), (0x605E, 0, 0), (0x1018, 1, profile.match.vendor))


def test_a_drive_of_the_field_without_a_profile_has_its_objects_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    table = read_objects_of(virtual.shipped_objects(), "maxon EPOS4 0x1018")
    monkeypatch.setattr(virtual, "profile_of_table", lambda _: None)
    made = as_in_table(drive_kind(MACHINE), table, MACHINE)
    assert (made.name, made.table, made.defaults) == (table.drive, table, ())


@pytest.mark.parametrize("named", ["my drive.EDS", "my drive.dcf", "Objects.CSV"])
def test_a_file_of_a_drive_is_read_whatever_its_ending_is_written_like(
    monkeypatch: pytest.MonkeyPatch, named: str
) -> None:
    read: list[tuple[Path, str]] = []
    monkeypatch.setattr(virtual, "read_objects_of", lambda path, drive: read.append((path, drive)))
    monkeypatch.setattr(virtual, "as_in_table", lambda *_: None)
    drive_kind(with_values(MACHINE, {"can.virtual_drive": named}))
    drive_kind(with_values(MACHINE, {"can.virtual_drive": f"Elmo@{named}"}))
    assert read == [(Path(named), ""), (Path(named), "Elmo")]


def test_nodes_beside_a_virtual_drive_go_on_by_its_sync() -> None:
    link, drive, (io, encoder) = virtual.virtual_bus(WITH_NODES)
    link.close()
    assert io is not None
    assert encoder is not None
    assert drive.stepped
    assert io.slave.stepped
    assert encoder.slave.stepped
    drive.stepped = False
    free = virtual_nodes.virtual_neighbours(WITH_NODES, drive, lambda can_id, data: None)
    assert [each is not None and each.slave.stepped for each in free] == [False, False]


# --- simulated plant --------------------------------------------------------------------------------------------------


def test_an_axis_without_ends_is_turned_back_from_either_side() -> None:
    """Two turns below 0 are 2288 of the motor: 35 times the 64 of the encoder, and 48."""
    state = {
        "pos_load": -4.0 * math.pi - 0.1,
        "pos_motor": -2288.0 * math.tau - 114.4,
        "count_offset": 50.0 * 4_194_304 + 5.0,
    }
    found = simulator.turned_back(modulo_machine(), state)
    assert (found["pos_load"], found["pos_motor"]) == approx((-0.1, -114.4), abs=1e-8)
    assert found["count_offset"] == 2.0 * 4_194_304 + 5.0


def test_a_drive_without_a_plant_stops_by_the_quick_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    made: dict[str, Any] = {}
    monkeypatch.setattr(simulator, "IdealDrive", lambda *_, **given: made.update(given))
    simulator.ideal_drive(IDEAL)
    assert deg(made["quick_dec_rad_s2"]) == approx(5.4)


def two(preload_nm: float, lost: str = "none") -> Machine:
    """The reference gantry with two pinions."""
    changes = {
        "switches.second_pinion": True,
        "second_pinion.preload_nm": preload_nm,
        "second_pinion.lost": lost,
    }
    return with_values(MACHINE, {f"plant.{key}": value for key, value in changes.items()})


@pytest.mark.parametrize("preload_nm", [25.0, -25.0])
def test_two_motors_press_against_each_other_either_way(preload_nm: float) -> None:
    assert simulator.drive_params(two(preload_nm)).preload_nm == preload_nm


@pytest.mark.parametrize("preload_nm", [25.0, -25.0])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_larger_share_is_half_and_the_preload_whatever_their_signs(preload_nm: float, way: float) -> None:
    """100 N m are 75 and 25; 750 would be 400, and a motor has 385."""
    assert larger_share_nm(two(preload_nm), way * 100.0) == 75.0
    assert larger_share_nm(two(preload_nm), way * 750.0) == 385.0
    for lost in ("first", "second"):
        assert larger_share_nm(two(preload_nm, lost), way * 100.0) == 100.0
    alone = with_values(MACHINE, {"plant.second_pinion.preload_nm": preload_nm})
    assert larger_share_nm(alone, way * 100.0) == 100.0


def test_a_ring_has_the_nearest_whole_number_of_teeth() -> None:
    """26 x 12.9995 are 337.987."""
    assert ring_teeth(with_values(MACHINE, {"axis.ring_ratio": 12.9995})) == 338


# --- calibration ------------------------------------------------------------------------------------------------------


def test_a_motor_that_was_not_identified_has_the_inertia_of_its_plate() -> None:
    """0.232 kg m2 behind 1144 are 303,626.8."""
    machine = improved_machine()
    base = machine.calibration
    assert base is not None
    identified = base.identified.model_copy(update={"motor_inertia_kg_m2": None, "inertia_kg_m2": 2.5e6})
    calibration = base.model_copy(update={"identified": identified})
    watch = calibration_watch(machine, calibration)
    assert watch is not None
    laws = compensation._identified(machine, calibration)
    assert (laws["inertia_load_kg_m2"], watch.inertia_load_kg_m2) == approx((2_196_373.2, 2_196_373.2))


def test_the_laws_get_each_map_in_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    machine = improved_machine()
    made: Any = lambda *given: given  # noqa: E731
    core = SimpleNamespace(Compensation=made, BACKLASH_MODELS=8)
    monkeypatch.setattr(compensation, "_core", core)
    given: Any = compensation.compensation(machine)
    assert machine.calibration is not None
    maps = machine.calibration.maps
    assert len({len(maps.gear_rad), len(maps.reversal_rad), len(maps.scale_rad), len(maps.fast)}) == 4
    assert given[2:] == (list(maps.gear_rad), list(maps.reversal_rad), list(maps.scale_rad), list(maps.fast))


class Fails(GantryProgram):
    """A program that is told when to fail."""

    now = False

    def logic(self, image: InputImage) -> None:
        if self.now:
            raise ArithmeticError("planted")
        super().logic(image)


def test_a_crane_whose_program_has_failed_is_braked_at_rest_and_held_until_its_brake_has_closed() -> None:
    """3.6 deg/s with 0.73 deg/s2 are 4.9 s of ramp; a brake of 0.4 s."""
    machine = with_values(
        axis_of("draft of crane_slew"),
        {
            "drive.kind": "ideal",
            "control.scan_period_ms": 10.0,
            "brake.close_time_ms": 400.0,
            "monitors.brake_feedback_time_ms": 500.0,
        },
    )
    runs = engine.build_engine(machine, program=Fails)
    operator, program = runs.operator, runs.program
    assert isinstance(operator, FixedOperator)
    assert isinstance(program, Fails)
    operator.command = OperatorCommand(power=True)
    runs.run_for(1.0)
    operator.command = OperatorCommand(power=True, move=True, target_rad=rad(100.0), speed_rad_s=rad(3.6))
    runs.run_for(13.0)
    ratio = machine.axis.ratio
    assert runs.image.drive.vel_act_rad_s == pytest.approx(rad(3.6) * ratio, rel=1e-3)
    program.now = True
    with pytest.raises(ScanFailure):
        runs.run_for(0.01)
    runs.run_until(lambda runs: not runs.output.brake_open, 10.0)
    assert abs(runs.image.drive.vel_act_rad_s) < rad(0.1) * ratio
    closing_s = runs.time_s
    runs.run_until(lambda runs: runs.output.request is DriveRequest.DISABLE, 2.0)
    assert runs.time_s - closing_s >= 0.4
