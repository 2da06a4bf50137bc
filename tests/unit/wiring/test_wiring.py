"""Machine file to engine: units, kinds of drive, and that the controller knows nothing of the plant."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import pytest

from gantryctl.drives.ideal import IdealDrive
from gantryctl.drives.simulated import SimDrive
from gantryctl.errors import ConfigError
from gantryctl.image import DriveIdentity, OperatorCommand
from gantryctl.machine import Machine, configs_folder, default_machine, load_machine, with_values
from gantryctl.program import Axis, AxisProgram, AxisState, GantryProgram
from gantryctl.runtime import (
    FixedOperator,
    OverrunPolicy,
    RealClock,
    ScriptedOperator,
    VirtualClock,
)
from gantryctl.runtime.recorder import MemoryRecorder
from gantryctl.units import deg, rad
from gantryctl.wiring import simulator
from gantryctl.wiring.engine import build_engine, build_program, recording_metadata
from gantryctl.wiring.program import (
    axis_settings,
    motion_limits,
    position_law,
    ramps_deg,
    travel_settings,
)
from gantryctl.wiring.simulator import delivered_zero_counts, drive_params, plant_params, sim_drive

MACHINE = default_machine()
IDEAL = with_values(MACHINE, {"drive.kind": "ideal"})
BUS = load_machine(configs_folder() / "hust_can.toml")
REAL = with_values(BUS, {"can.interface": "socketcan", "can.channel": "can0"})


def drive(**values: Any) -> Any:
    """An open drive, as far as an engine that is not run asks it."""
    identity = DriveIdentity("drive", "SIM-0001", 524_288, 4096, error_texts={0x3210: "too high"})
    return SimpleNamespace(
        **{"identity": lambda: identity, "torque_preload": True, "reports_torque": True, "truth_source": None}
        | values
    )


def test_the_ratio_and_the_count_are_those_of_the_paper() -> None:
    assert MACHINE.axis.ratio == 1144.0
    assert MACHINE.counts_per_turn == 2048 * 2048


def test_settings_are_the_machine_file_in_si() -> None:
    settings = axis_settings(MACHINE)
    assert deg(settings.travel.pos_max_rad) == pytest.approx(180.0)
    assert deg(settings.speed.setting_min_rad_s) == pytest.approx(0.6)
    assert deg(settings.ramps.quick_dec_rad_s2) == pytest.approx(MACHINE.virtual_axis.quick_dec_deg_s2)
    assert settings.ramps.jerk_rad_s3 == math.inf  # trapezoid
    assert settings.period_s == pytest.approx(1e-3)
    assert settings.law.kpp_per_s == MACHINE.control.kpp_per_s
    assert settings.monitors.lease_s == pytest.approx(0.25)
    assert axis_settings(MACHINE, 12.5).power.holding_torque_nm == 12.5


def test_the_jerk_limited_profile_has_its_jerk() -> None:
    smooth = with_values(MACHINE, {"virtual_axis.profile": "jerk_limited"})
    assert deg(axis_settings(smooth).ramps.jerk_rad_s3) == pytest.approx(MACHINE.virtual_axis.jerk_deg_s3)
    assert motion_limits(smooth).jerk_rad_s3 < math.inf
    assert ramps_deg(smooth, 6.0) > ramps_deg(MACHINE, 6.0)


def test_the_shortest_move_that_reaches_a_speed() -> None:
    assert ramps_deg(MACHINE, 6.0) == pytest.approx(91.5, abs=0.05)
    assert ramps_deg(MACHINE, 0.6) == pytest.approx(0.9, abs=0.05)


# Everything the controller is made of stays the same whatever the plant is: a compensation that knew it would cheat.
PLANT_CHANGES = {
    "plant.load.inertia_kg_m2": 2.0e6,
    "plant.transmission.backlash_mm": 0.3,
    "plant.gear_error.scale": 0.1,
    "plant.switches.base": False,
    "plant.motor_friction.coulomb_nm": 2.0,
    "plant.encoder.serial": "OTHER",
}


@pytest.mark.parametrize("path", PLANT_CHANGES)
def test_the_controller_reads_nothing_of_the_plant(path: str) -> None:
    changed = with_values(MACHINE, {path: PLANT_CHANGES[path]})
    assert axis_settings(changed) == axis_settings(MACHINE)
    law, reference = position_law(changed), position_law(MACHINE)
    assert law.scan(0.3, 0.1, 1e6) == reference.scan(0.3, 0.1, 1e6)


def test_a_switch_that_is_off_makes_its_effect_exactly_absent() -> None:
    off = with_values(MACHINE, {"plant.switches.eccentric_moment": False, "plant.switches.backlash": False})
    params = plant_params(off)
    assert params.eccentric_moment_nm == 0.0
    assert params.half_backlash_rad == 0.0
    assert plant_params(MACHINE).eccentric_moment_nm == pytest.approx(-16.0e3, rel=0.01)


def test_the_drive_has_the_encoder_evaluation_of_the_file() -> None:
    fine = 2.0 * math.pi / MACHINE.counts_per_turn
    for feedback, count in (("ideal", 0.0), ("interpolated", fine), ("counts", 2.0 * math.pi / 8192)):
        params = drive_params(with_values(MACHINE, {"drive.speed_loop.feedback": feedback}))
        assert params.speed_count_rad == params.position_count_rad == count


@pytest.mark.parametrize("machine", [MACHINE, IDEAL], ids=["sim", "ideal"])
@pytest.mark.parametrize("angle_deg", [0.0, 90.0, -150.0])
def test_a_delivered_machine_reads_its_angle(machine: object, angle_deg: float) -> None:
    from gantryctl.operation.opening import new_machine

    made = new_machine(machine, angle_deg)
    counts = made.drive.read().pos_act_counts - delivered_zero_counts(machine)
    assert counts / MACHINE.counts_per_turn / 1144.0 * 360.0 == pytest.approx(angle_deg, abs=0.02)


def test_the_kind_of_drive_follows_the_file() -> None:
    assert isinstance(build_engine(MACHINE).drive, SimDrive)
    ideal = build_engine(IDEAL)
    assert isinstance(ideal.drive, IdealDrive)
    assert ideal.truth is None
    assert build_engine(MACHINE).truth is not None


def test_the_clock_is_virtual_unless_real_time_is_asked_for() -> None:
    assert isinstance(build_engine(IDEAL).clock, VirtualClock)
    assert isinstance(build_engine(IDEAL, real_time=True).clock, RealClock)


@pytest.mark.parametrize(
    ("machine", "asked", "paced", "policy"),
    [
        (IDEAL, False, False, OverrunPolicy.CONTINUE),
        # A simulated plant waits for a late scan.
        (IDEAL, True, True, OverrunPolicy.CONTINUE),
        (BUS, False, False, OverrunPolicy.CONTINUE),
        (BUS, True, True, OverrunPolicy.QUICK_STOP),
        (REAL, False, True, OverrunPolicy.QUICK_STOP),
    ],
    ids=["ideal", "ideal by the clock", "virtual bus", "virtual bus by the clock", "real bus"],
)
def test_a_drive_that_goes_on_alone_is_paced_by_the_clock_and_stopped_when_scans_are_late(
    machine: Machine, asked: bool, paced: bool, policy: OverrunPolicy
) -> None:
    made = drive()
    program = build_program(machine, made, zero_counts=0.0)
    engine = build_engine(machine, made, program, real_time=asked)
    assert isinstance(engine.clock, RealClock if paced else VirtualClock)
    assert engine.overrun_policy is policy


def test_a_program_has_the_limits_of_its_drive() -> None:
    program = build_program(
        REAL, drive(torque_preload=False), zero_counts=0.0, holding_torque_nm=-7.0, speed_max_deg_s=2.5,
        quick_dec_deg_s2=3.0,
    )  # fmt: skip
    axis, settings = program.axis, program.axis.settings
    assert deg(settings.speed.setting_max_rad_s) == pytest.approx(2.5)
    assert deg(settings.ramps.quick_dec_rad_s2) == pytest.approx(3.0)
    assert (settings.power.torque_preload, settings.power.holding_torque_nm) == (False, -7.0)
    assert settings.error_texts == {0x3210: "too high"}
    # A zero at count 0 is a zero.
    assert axis.zero_counts == 0.0
    assert build_program(IDEAL, drive()).axis.zero_counts == 4096 * 4_194_304 // 2
    assert build_program(IDEAL, drive()).axis.settings.error_texts == {}


@pytest.mark.parametrize(("serial", "fits"), [("SIM-0001", True), ("SIM-0002", False)])
def test_maps_of_another_encoder_move_no_axis(serial: str, fits: bool) -> None:
    machine = load_machine(configs_folder() / "hust_improved.toml")
    made = drive(identity=lambda: DriveIdentity("drive", serial, 4_194_304, 4096))
    if fits:
        build_program(machine, made, zero_counts=0.0)
    else:
        with pytest.raises(ConfigError, match=serial):
            build_program(machine, made, zero_counts=0.0)


def test_a_recording_says_whose_it_is_and_its_period() -> None:
    found = recording_metadata(REAL)
    assert (found["machine"], found["period_s"]) == ("hust_can", 0.004)


def test_an_engine_stands_with_power_off_and_powers_up_when_told() -> None:
    engine = build_engine(IDEAL)
    assert isinstance(engine.program, GantryProgram)
    assert isinstance(engine.operator, FixedOperator)
    engine.run_for(0.1)
    assert engine.program.axis.state is AxisState.DISABLED
    engine.operator.command = OperatorCommand(power=True)
    assert engine.run_until(lambda e: e.program.axis.state is AxisState.STANDSTILL, 3.0)


def test_an_operator_and_a_program_of_ones_own_are_used() -> None:
    class Mine(AxisProgram):
        def __init__(self, axis: Axis) -> None:
            super().__init__(axis)
            self.scans = 0

        def logic(self, _: object) -> None:
            self.scans += 1

    operator = ScriptedOperator([(0.0, OperatorCommand())])
    engine = build_engine(IDEAL, program=Mine, operator=operator)
    engine.run_for(0.05)
    assert engine.operator is operator
    assert isinstance(engine.program, Mine)
    assert engine.program.scans == 50


def test_the_recorder_gets_the_columns_of_program_and_truth() -> None:
    seen: list[tuple[str, ...]] = []

    def recorder(columns: tuple[str, ...]) -> MemoryRecorder:
        seen.append(columns)
        return MemoryRecorder(columns)

    engine = build_engine(MACHINE, recorder=recorder)
    assert engine.trace().metadata["machine"] == "hust_gantry"
    assert engine.trace().period_s == pytest.approx(1e-3)
    build_engine(IDEAL, recorder=recorder)
    assert "pos_load_rad" in seen[0]
    assert "pos_load_rad" not in seen[1]
    assert seen[0][:2] == ("time_s", "pos_ref_rad")


def test_a_state_that_lacks_something_is_refused() -> None:
    state = sim_drive(MACHINE).sim.state
    del state["pos_load"]
    with pytest.raises(ValueError, match="pos_load"):
        sim_drive(MACHINE, state=state)


def test_plans_are_kept_when_asked_for() -> None:
    engine = build_engine(IDEAL, keep_plans=True)
    assert isinstance(engine.program, GantryProgram)
    assert isinstance(engine.operator, FixedOperator)
    engine.operator.command = OperatorCommand(power=True)
    engine.run_for(1.0)
    engine.operator.command = OperatorCommand(
        power=True, move=True, target_rad=rad(1.0), speed_rad_s=rad(1.0)
    )
    engine.run_for(0.1)
    assert len(engine.program.axis.plans) == 2


def test_a_gentle_end_lengthens_the_shortest_move() -> None:
    """0.2 deg/s2 at 0.1 instead of 0.4 deg/s3 take 1.5 s longer, from 0.2 deg/s on: 0.3 deg."""
    base = {"virtual_axis.profile": "jerk_limited", "virtual_axis.jerk_deg_s3": 0.4}
    end = {"virtual_axis.end_dec_deg_s2": 0.2, "virtual_axis.end_jerk_deg_s3": 0.1}
    plain = with_values(MACHINE, base | end)
    gentle = with_values(plain, {"virtual_axis.gentle_end": True})
    assert ramps_deg(gentle, 3.0) - ramps_deg(plain, 3.0) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("machine", "changes", "fine"),
    [
        (MACHINE, {}, True),
        (MACHINE, {"drive.speed_loop.feedback": "counts"}, False),
        (IDEAL, {}, False),
        (BUS, {}, True),
        # The loop of a drive on a bus has its own reading; the controller sees 6064.
        (BUS, {"drive.speed_loop.feedback": "counts"}, True),
        (BUS, {"can.increments_per_turn": 2**18}, True),
        (BUS, {"can.increments_per_turn": 2**18 - 1}, False),
    ],
)
def test_an_encoder_shows_the_twist_of_a_shaft_from_18_bits_on(
    machine: Machine, changes: dict[str, object], fine: bool
) -> None:
    """30 N m turn the shaft by 3.75e-5 rad against its closed brake: 1.6 steps of 18 bits."""
    monitors = axis_settings(with_values(machine, changes)).monitors
    assert monitors.encoder_shows_twist is fine
    assert monitors.torque_still_max_nm == pytest.approx(40.0 if fine else math.inf)


def test_torque_under_which_a_reading_may_stand_still_goes_with_the_motor() -> None:
    """40 of the reference gantry's 257 N m; the table's motor has 1.9 N m at most, and 0.64 rated."""
    table = load_machine(configs_folder() / "rotary_table.toml")
    assert axis_settings(table).monitors.torque_still_max_nm == pytest.approx(0.0996, rel=1e-3)
    dish = load_machine(configs_folder() / "azimuth_dish.toml")
    assert axis_settings(dish).monitors.torque_still_max_nm == pytest.approx(28.4, rel=2e-3)


@pytest.mark.parametrize(
    ("brake_nm", "bits", "least_nm"), [(400.0, 18, 30.0), (400.0, 19, 15.0), (440.0, 20, 8.25)]
)
def test_the_torque_that_turns_a_shaft_by_a_step_goes_with_its_brake(brake_nm, bits, least_nm):
    """1.6 steps of the 5e-4 rad by all of the brake's torque."""
    changes = {"brake.torque_nm": brake_nm, "can.increments_per_turn": 2**bits}
    assert axis_settings(with_values(BUS, changes)).monitors.twist_least_nm == pytest.approx(least_nm)


@pytest.mark.parametrize(
    ("backlash_mm", "thermal", "switch", "gap"),
    [(0.2, False, True, True), (0.0, False, True, False), (0.0, True, True, True), (0.2, True, False, False)],
)
def test_gears_that_close_at_one_temperature_have_a_gap_at_another(
    backlash_mm: float, thermal: bool, switch: bool, gap: bool
) -> None:
    changes = {"plant.transmission.backlash_mm": backlash_mm, "plant.switches.backlash": switch}
    assert plant_params(with_values(MACHINE, changes | {"plant.switches.thermal": thermal})).backlash is gap


def test_the_zero_of_a_new_machine_lies_behind_the_lead_of_its_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    """The motor of a load at 20 deg that it leads by a quarter of a degree stands at 20.25 deg."""
    monkeypatch.setattr(simulator, "lead_deg", lambda machine, angle_deg: 0.25)
    read = sim_drive(MACHINE, 20.0).read().pos_act_counts
    motor_deg = (read - delivered_zero_counts(MACHINE, 20.0)) / 4_194_304 / 1144.0 * 360.0
    assert motor_deg == pytest.approx(20.25, abs=1e-6)


@pytest.mark.parametrize(
    ("jog_dec_deg_s2", "way_deg"),
    [
        # (4 ms)^2 / 4k, k = (1/2.0 - 1/5.4) / 2; without a difference of the ramps 6 deg/s for 4 ms.
        (2.0, 2.541176e-5),
        (5.4, 0.024),
    ],
)
def test_a_sector_that_is_not_entered_has_its_margins(jog_dec_deg_s2: float, way_deg: float) -> None:
    """Four scans of 1 ms ahead; 0.03 deg of following error, twice of it and the way between the two ramps."""
    changes = {"axis.no_go_deg": [[40.0, 50.0]], "virtual_axis.jog_release_dec_deg_s2": jog_dec_deg_s2}
    found = travel_settings(with_values(MACHINE, changes))
    (sector,) = found.no_go_rad
    assert sector == pytest.approx((rad(40.0), rad(50.0)))
    assert found.no_go_lead_s == pytest.approx(0.004)
    slow = with_values(MACHINE, changes | {"control.scan_period_ms": 4.0})
    assert travel_settings(slow).no_go_lead_s == pytest.approx(0.016)
    assert deg(found.no_go_margin_rad) == pytest.approx(0.03)
    assert deg(found.no_go_clearance_rad) == pytest.approx(0.06 + way_deg, rel=1e-6)
    assert travel_settings(MACHINE).no_go_rad == ()
