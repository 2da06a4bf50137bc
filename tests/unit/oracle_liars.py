"""Liars: each breaks one invariant of the oracle on a small bench of its own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from gantryctl.engineering.faults.inject import inject
from gantryctl.engineering.faults.injection import injection
from gantryctl.engineering.faults.kinds.kind import Value
from gantryctl.image import DriveFeedback, DriveRequest, DriveState, Mode, OutputImage
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import AlarmLog, Refusal, refusal
from gantryctl.program.alarms.words import Said, Words
from gantryctl.program.axis.commands import MotionCommands
from gantryctl.program.axis.turns import Turns
from gantryctl.program.blocks import Jog
from gantryctl.program.feedback import Feedback
from gantryctl.program.gantry import GantryProgram
from gantryctl.program.monitors.liveness import Liveness
from gantryctl.program.monitors.recovery import StopRecord
from gantryctl.runtime import Engine, FixedOperator
from gantryctl.units import rad
from gantryctl.wiring.engine import build_engine, drive_of
from support.fault_rows import target_of
from support.modulo_machine import modulo_machine

RATIO = default_machine().axis.ratio
QUICK_RAMPS = {"virtual_axis__acc_deg_s2": 2.0, "virtual_axis__dec_deg_s2": 2.0}


class Bench:
    """The shipped program on a simulated gantry, standing at 90 deg, where the load pulls most."""

    def __init__(self, at_deg: float = 90.0, machine: Machine | None = None, **changes: object) -> None:
        values = {path.replace("__", "."): value for path, value in changes.items()}
        self.machine: Machine = with_values(machine or default_machine(), values)
        self.drive = drive_of(self.machine, at_deg)
        self.engine: Engine = build_engine(self.machine, self.drive)

    def inject(self, where: str, kind: str, /, **args: Value) -> None:
        """Let a fault act, and tell it the oracle."""
        inject(target_of(self.machine, self.drive, self.engine), injection(where, kind, **args))

    def op(self, **levels: object) -> None:
        operator = self.engine.operator
        assert isinstance(operator, FixedOperator)
        operator.command = operator.command._replace(**levels)
        self.engine.step()

    def up(self) -> Bench:
        self.op(power=True)
        self.engine.run_for(2.0)
        return self

    def moving(self, speed_deg_s: float = 6.0) -> Bench:
        """In the middle of a move towards 0 deg."""
        self.up().op(move=True, target_rad=0.0, speed_rad_s=rad(speed_deg_s))
        self.op(move=False)
        self.engine.run_for(10.0)
        return self


class Between:
    """Something between the program and the drive that changes what is sent."""

    def __init__(self, bench: Bench, change: Callable[[OutputImage], OutputImage]) -> None:
        self._drive, self._change = bench.drive, change
        bench.engine.drive = self

    def read(self) -> DriveFeedback:
        return self._drive.read()

    def write(self, output: OutputImage) -> None:
        self._drive.write(self._change(output))


def plant(bench: Bench, change: Callable[[int, float, float, bool], tuple[int, float, float, bool]]) -> None:
    """Change what the drive does, behind the wire."""
    true = bench.drive._scan
    bench.drive._scan = lambda *command: true(*change(*command))


def silent_bus(speed_deg_s: float, **changes: object) -> Bench:
    """An axis in motion behind a bus on which the controller has just died; two seconds later."""
    bench = Bench(drive__kind="canopen", control__scan_period_ms=4.0, virtual_axis__acc_deg_s2=2.0, **changes)
    bench.up().op(move=True, target_rad=0.0, speed_rad_s=rad(speed_deg_s))
    bench.engine.run_for(4.0)
    for _ in range(500):
        bench.drive.link.pause(0.004)
    return bench


# --- liars: each breaks one invariant -----------------------------------------------------------------------------


def a_brake_without_strength(_: pytest.MonkeyPatch) -> None:
    bench = Bench(plant__brake__torque_share=0.3).moving()
    bench.inject("input", "off", name="estop_ok")
    bench.engine.run_for(3.0)


def a_drive_that_goes_on_without_commands(_: pytest.MonkeyPatch) -> None:
    silent_bus(3.0, can__virtual_drive="unwatched").drive.link.close()


def a_drive_that_goes_on_slowly_without_commands(_: pytest.MonkeyPatch) -> None:
    silent_bus(0.6, can__virtual_drive="unwatched").drive.link.close()


def a_drive_that_creeps(_: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    plant(bench, lambda mode, vel, *rest: (mode, vel + rad(0.2) * RATIO if mode else vel, *rest))
    bench.engine.run_for(2.0)


def a_move_that_does_not_end(_: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    bench.op(move=True, target_rad=rad(90.5), speed_rad_s=rad(6.0))
    bench.op(move=False)
    bench.engine.run_for(6.0)
    creeps = rad(0.2) * RATIO
    Between(bench, lambda output: output._replace(vel_cmd_rad_s=output.vel_cmd_rad_s + creeps))
    bench.engine.run_for(0.1)


def a_move_after_power_off(patch: pytest.MonkeyPatch) -> None:
    """The ramp to rest is taken over by it, and power goes off after its end."""
    patch.setattr(MotionCommands, "_check_ready", lambda _: None)
    bench = Bench().moving()
    bench.op(power=False)
    bench.op(move=True, target_rad=rad(-90.0))
    bench.op(move=False)
    bench.engine.run_for(6.0)


def takes_over_and_refuses(patch: pytest.MonkeyPatch) -> None:
    """A key takes over from a move, and people are told that it is refused."""

    def start(jog: Jog, direction: int, velocity_rad_s: float) -> None:
        if jog.axis.motion.current is not None:
            jog.axis.report_refusal(refusal(Code.CTL_14, reason=Words.JOG_FROM_REST))
        jog._direction, jog._speed, jog._released = direction, velocity_rad_s, False
        jog._begin(jog.axis.motion.move_velocity(direction * velocity_rad_s, held=True))

    patch.setattr(Jog, "_start", start)


def key_in_a_move(bench: Bench, target_deg: float, at_s: float, held_s: float) -> None:
    """At 3 deg/s from 90 deg, where the forward key is pressed."""
    bench.up().op(move=True, target_rad=rad(target_deg), speed_rad_s=rad(3.0), mode=Mode.CONTINUOUS)
    bench.op(move=False)
    bench.engine.run_for(at_s)
    for lease in range(round(held_s / 0.03)):
        bench.op(forward=True, lease=lease + 1)
        bench.engine.run_for(0.03)
    bench.op(forward=False)
    bench.engine.run_for(3.0)


def a_key_that_takes_over_a_move_to_turn_back(patch: pytest.MonkeyPatch) -> None:
    takes_over_and_refuses(patch)
    key_in_a_move(Bench(**QUICK_RAMPS), 60.0, 1.5, 3.0)


def a_key_that_takes_over_a_move_and_goes_beyond_its_target(patch: pytest.MonkeyPatch) -> None:
    takes_over_and_refuses(patch)
    key_in_a_move(Bench(**QUICK_RAMPS), 95.0, 1.0, 3.0)


def a_key_that_goes_the_other_way(patch: pytest.MonkeyPatch) -> None:
    true = Jog._start
    patch.setattr(Jog, "_start", lambda jog, direction, *rest: true(jog, -direction, *rest))
    bench = Bench(**QUICK_RAMPS).up()
    bench.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(1.0))
    bench.op(forward=True, lease=1)
    bench.engine.run_for(1.0)


def an_increment_that_is_too_long(patch: pytest.MonkeyPatch) -> None:
    true = MotionCommands.move_relative
    patch.setattr(MotionCommands, "move_relative", lambda motion, way, *rest: true(motion, 2.0 * way, *rest))
    bench = Bench(**QUICK_RAMPS).up()
    bench.op(mode=Mode.INCREMENTAL, increment_rad=rad(1.0), speed_rad_s=rad(1.0))
    bench.op(forward=True)
    bench.op(forward=False)
    bench.engine.run_for(4.0)


def a_move_that_is_told_to_be_refused(patch: pytest.MonkeyPatch) -> None:
    told = refusal(Code.PWR_03)
    patch.setattr(GantryProgram, "_check_move", lambda program, _: program.axis.report_refusal(told))
    bench = Bench(**QUICK_RAMPS).up()
    bench.op(move=True, target_rad=rad(80.0), speed_rad_s=rad(3.0))
    bench.op(move=False)
    bench.engine.run_for(1.0)


def key_at_rest(patch: pytest.MonkeyPatch, refused: Refusal) -> None:
    patch.setattr(GantryProgram, "_check_keys", lambda *_: refused)
    bench = Bench().up()
    bench.op(mode=Mode.CONTINUOUS, speed_rad_s=rad(1.0))
    bench.op(forward=True, lease=1)


def a_motion_that_forbids_a_key_at_rest(patch: pytest.MonkeyPatch) -> None:
    key_at_rest(patch, refusal(Code.CTL_14, reason=Words.JOG_FROM_REST))


def a_lease_that_has_run_out_as_it_is_renewed(patch: pytest.MonkeyPatch) -> None:
    key_at_rest(patch, refusal(Code.CTL_15, measured=260.0, limit=250.0))


def a_drive_that_comes_on_with_an_alarm(_: pytest.MonkeyPatch) -> None:
    """Within the time in which an ENABLE of before may act; there was none."""
    bench = Bench()
    bench.engine.run_for(0.1)
    drive, alarms = bench.drive, bench.engine.program.axis.alarms
    drive.trip(0x2310)
    assert bench.engine.run_until(lambda _: alarms.first_out is not None, 0.1)
    drive._transition = lambda _: setattr(drive, "state", DriveState.OPERATION_ENABLED)
    bench.engine.step()


def an_enable_of_nobody_for_a_scan(_: pytest.MonkeyPatch) -> None:
    """It brings no torque; in the scan before an alarm it would."""
    bench = Bench()
    bench.engine.run_for(0.1)
    Between(bench, lambda output: output._replace(request=DriveRequest.ENABLE))
    bench.engine.step()


def a_motor_that_turns_while_off(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(AlarmLog, "raise_", lambda *_, **__: None)
    bench = Bench()
    bench.engine.run_for(0.1)
    plant(bench, lambda mode, vel, ff, brake: (1, rad(0.5) * RATIO, ff, True))
    bench.engine.run_for(1.0)


def an_enable_that_nobody_asked_for(_: pytest.MonkeyPatch) -> None:
    bench = Bench()
    Between(bench, lambda output: output._replace(request=DriveRequest.ENABLE))
    bench.engine.run_for(1.0)


def a_speed_that_jumps(_: pytest.MonkeyPatch) -> None:
    bench = Bench().moving(3.0)
    Between(bench, lambda output: output._replace(vel_cmd_rad_s=output.vel_cmd_rad_s + rad(0.5) * RATIO))
    bench.engine.run_for(0.01)


def a_speed_that_jumps_from_rest(_: pytest.MonkeyPatch) -> None:
    """No dither: it does not come back."""
    bench = Bench().up()
    Between(bench, lambda output: output._replace(vel_cmd_rad_s=output.vel_cmd_rad_s + rad(0.3) * RATIO))
    bench.engine.run_for(0.03)


def a_drive_that_turns_too_fast(_: pytest.MonkeyPatch) -> None:
    """Above 6.6 deg/s under torque, until monitors stop it: what a load adds that nothing holds is no excuse."""
    ceiling = {"speed__drive_ceiling_deg_s": 8.0, "speed__overspeed_trip_deg_s": 8.5}
    bench = Bench(virtual_axis__acc_deg_s2=2.0, **ceiling).moving()
    plant(bench, lambda mode, vel, *rest: (mode, 1.5 * vel, *rest))
    bench.engine.run_for(1.0)


def a_drive_that_goes_beyond_the_travel(patch: pytest.MonkeyPatch) -> None:
    bench = Bench(179.5).up()
    patch.setattr(AlarmLog, "raise_", lambda *_, **__: None)
    plant(bench, lambda mode, vel, *rest: (mode, rad(3.0) * RATIO, *rest))
    bench.engine.run_for(1.0)


def blind_move(bench: Bench, patch: pytest.MonkeyPatch, target_deg: float, seconds: float) -> None:
    """A move planned and watched without the no-go sectors that the machine file has."""
    patch.setattr(AlarmLog, "raise_", lambda *_, **__: None)
    axis = bench.up().engine.program.axis
    blind = replace(axis.settings.travel, no_go_rad=())
    axis.virtual._travel = blind
    axis.motion._settings = replace(axis.settings, travel=blind)
    bench.op(move=True, target_rad=rad(target_deg), speed_rad_s=rad(3.0))
    bench.op(move=False)
    bench.engine.run_for(seconds)


def a_program_that_goes_into_a_sector(patch: pytest.MonkeyPatch) -> None:
    blind_move(Bench(58.0, axis__no_go_deg=((60.0, 120.0),)), patch, 61.0, 6.0)


def a_program_that_goes_back_into_the_sector_that_it_has_left(patch: pytest.MonkeyPatch) -> None:
    bench = Bench(-60.5, axis__no_go_deg=((-120.0, -60.0),))
    blind_move(bench, patch, -58.0, 8.0)
    bench.op(move=True, target_rad=rad(-61.0))
    bench.op(move=False)
    bench.engine.run_for(8.0)


def a_modulo_axis_that_goes_through_a_sector_of_the_turn_before(patch: pytest.MonkeyPatch) -> None:
    machine = modulo_machine({"axis.no_go_deg": ((340.0, 350.0),)})
    blind_move(Bench(-8.0, machine), patch, -11.0, 6.0)


def a_number_that_is_none(_: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    Between(bench, lambda output: output._replace(vel_cmd_rad_s=math.nan))
    bench.engine.step()


def a_speed_without_enable(_: pytest.MonkeyPatch) -> None:
    bench = Bench()
    bench.engine.run_for(0.1)
    Between(bench, lambda output: output._replace(vel_cmd_rad_s=1e-9))
    bench.engine.step()


def a_frame_of_somebody_else(_: pytest.MonkeyPatch) -> None:
    bench = Bench(drive__kind="canopen", control__scan_period_ms=4.0)
    bench.engine.run_for(0.1)
    bench.drive.link.send(0x181, b"\0")
    bench.engine.close()


def a_drive_that_stays_enabled_after_an_alarm(_: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    Between(bench, lambda output: output._replace(request=DriveRequest.ENABLE))
    bench.op(quick_stop=True)
    bench.engine.run_for(1.0)


def a_brake_that_opens_without_torque(_: pytest.MonkeyPatch) -> None:
    bench = Bench()
    bench.engine.run_for(0.1)
    plant(bench, lambda mode, vel, ff, brake: (mode, vel, ff, True))
    bench.engine.run_for(1.0)


def torque_off_before_the_brake_holds(_: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    Between(
        bench, lambda output: output if output.brake_open else output._replace(request=DriveRequest.DISABLE)
    )
    bench.op(power=False)
    bench.engine.run_for(1.0)


def a_wrong_angle_that_is_called_valid(patch: pytest.MonkeyPatch) -> None:
    bench = Bench().up()
    patch.setattr(AlarmLog, "raise_", lambda *_, **__: None)
    patch.setattr(Feedback, "position_valid", True)
    bench.drive.lose_turns(1)
    bench.engine.run_for(0.5)


def frozen_at_rest() -> Bench:
    """An encoder freezes at the end of a ramp, while the load still swings."""
    ramps = {"virtual_axis__acc_deg_s2": 2.0, "virtual_axis__dec_deg_s2": 2.0}
    bench = Bench(plant__load__eccentricity_m=0.025, **ramps).moving()
    virtual = bench.engine.program.axis.virtual
    assert bench.engine.run_until(lambda _: virtual.at_rest, 15.0)
    bench.inject("encoder", "gain", value=0.0)
    bench.engine.run_for(2.0)
    return bench


def a_frozen_reading_that_nobody_asks(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Liveness, "stand", lambda *_, **__: None)
    frozen_at_rest()


def a_quick_stop_that_loses_its_torque(patch: pytest.MonkeyPatch) -> None:
    """Nobody is told, so the way stays that of the ramp."""
    bench = Bench().moving()
    bench.op(quick_stop=True)
    bench.engine.run_for(0.2)
    patch.setattr(AlarmLog, "raise_", lambda *_, **__: None)
    bench.inject("brake", "torque", share=0.6)
    bench.inject("input", "off", name="estop_ok")
    bench.engine.run_for(3.0)


def a_wrong_way_in_the_words(patch: pytest.MonkeyPatch) -> None:
    words = StopRecord._steps

    def wrong(record: StopRecord, feedback: Feedback, pos_rad: float) -> tuple[Words | Said, ...]:
        return tuple(
            Words.MOVED_TO(way=float(str(step.values["way"])) + 0.2, position=step.values["position"])
            if isinstance(step, Said) and step.words is Words.MOVED_TO
            else step
            for step in words(record, feedback, pos_rad)
        )

    patch.setattr(StopRecord, "_steps", wrong)
    stopped(Bench().moving())


def a_wrong_time_in_the_words(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(StopRecord, "_steps", lambda *_: (Words.AT_REST_AFTER(time_ms=1.0),))
    stopped(Bench().moving())


def nothing_was_switched_on(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(StopRecord, "_steps", lambda *_: (Words.NOTHING_ON,))
    stopped(Bench().moving())


def a_stop_without_an_alarm(_: pytest.MonkeyPatch) -> None:
    bench = Bench().moving()
    Between(bench, lambda output: output._replace(request=DriveRequest.QUICK_STOP, vel_cmd_rad_s=0.0))
    bench.engine.step()


def stopped(bench: Bench) -> None:
    """A quick stop by a person, to its end."""
    bench.op(quick_stop=True)
    bench.engine.run_for(4.0)


def turning() -> Bench:
    """An axis that turns without end; at rest at 290 deg a turn goes into its zero."""
    bench = Bench(250.0, modulo_machine({"encoder.turns": 4096, "plant.encoder.mounting_turns": 2048}))
    bench.up().op(move=True, relative=True, target_rad=rad(40.0), speed_rad_s=rad(6.0))
    bench.op(move=False)
    bench.engine.run_for(14.0)
    return bench


def a_turn_that_is_not_whole(patch: pytest.MonkeyPatch) -> None:
    true = Turns.move_on
    # 0.2 deg of the axis.
    off = 0.2 / 360.0 * default_machine().counts_per_turn * RATIO
    patch.setattr(Turns, "move_on", lambda turns, made: true(turns, made) + off)
    turning()


def a_zero_that_moves_under_a_motion_to_an_angle(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(
        Turns, "due", lambda turns, pos_rad, **_: round(pos_rad / math.tau) if abs(pos_rad) > 4.6 else 0
    )
    turning()


LIARS = [
    ("INV-7", a_turn_that_is_not_whole),
    ("INV-7", a_zero_that_moves_under_a_motion_to_an_angle),
    ("INV-1", a_brake_without_strength),
    ("INV-1", a_quick_stop_that_loses_its_torque),
    pytest.param("INV-1", a_drive_that_goes_on_without_commands, marks=pytest.mark.can),
    pytest.param("INV-1", a_drive_that_goes_on_slowly_without_commands, marks=pytest.mark.can),
    ("INV-2", a_drive_that_creeps),
    ("INV-2", a_move_that_does_not_end),
    ("INV-2", a_move_after_power_off),
    ("INV-2", a_key_that_takes_over_a_move_to_turn_back),
    ("INV-2", a_key_that_takes_over_a_move_and_goes_beyond_its_target),
    ("INV-2", a_key_that_goes_the_other_way),
    ("INV-2", an_increment_that_is_too_long),
    ("INV-2", a_move_that_is_told_to_be_refused),
    ("INV-2", an_enable_of_nobody_for_a_scan),
    ("INV-2", a_motor_that_turns_while_off),
    ("INV-2", an_enable_that_nobody_asked_for),
    ("INV-3", a_speed_that_jumps),
    ("INV-3", a_speed_that_jumps_from_rest),
    ("INV-3", a_drive_that_turns_too_fast),
    ("INV-3", a_drive_that_goes_beyond_the_travel),
    ("INV-3", a_program_that_goes_into_a_sector),
    ("INV-3", a_program_that_goes_back_into_the_sector_that_it_has_left),
    ("INV-3", a_modulo_axis_that_goes_through_a_sector_of_the_turn_before),
    ("INV-4", a_number_that_is_none),
    ("INV-4", a_speed_without_enable),
    pytest.param("INV-4", a_frame_of_somebody_else, marks=pytest.mark.can),
    ("INV-5", a_drive_that_stays_enabled_after_an_alarm),
    ("INV-5", a_drive_that_comes_on_with_an_alarm),
    ("INV-6", a_brake_that_opens_without_torque),
    ("INV-6", torque_off_before_the_brake_holds),
    ("INV-7", a_wrong_angle_that_is_called_valid),
    ("INV-7", a_frozen_reading_that_nobody_asks),
    ("INV-7", a_wrong_way_in_the_words),
    ("INV-7", a_wrong_time_in_the_words),
    ("INV-7", nothing_was_switched_on),
    ("INV-7", a_stop_without_an_alarm),
    ("INV-7", a_motion_that_forbids_a_key_at_rest),
    ("INV-7", a_lease_that_has_run_out_as_it_is_renewed),
]
"""Invariant, and who breaks it."""
