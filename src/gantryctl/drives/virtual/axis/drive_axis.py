"""Drive axis: the CiA 402 state machine on top of the power stage, with the option codes for leaving a state.

| from                  | to                 | by                                                                  |
|-----------------------|--------------------|---------------------------------------------------------------------|
| Switched on           | Operation enabled  | preload, brake open, then the state                                 |
| Operation enabled     | Switched on        | 605C: ramp, brake closed, then the state; or torque off at once     |
| Operation enabled     | Ready to switch on | 605B: the same                                                      |
| Operation enabled     | Quick stop active  | the state at once, the ramp of 605A in it; then held, or disabled   |
| Operation enabled     | Switch on disabled | torque off at once                                                  |
| Quick stop active     | Operation enabled  | 605A 5..8 only; after a stop by 6007 another command must come first |
| any                   | Fault              | Fault reaction active with the ramp of 605E; or torque off at once  |
"""

from __future__ import annotations

from typing import Final

from gantryctl.drives.faults import Faults
from gantryctl.drives.virtual.axis.cia402 import (
    FAULT_RESET_BIT,
    AbortConnection,
    Command,
    Ramp,
    State,
    command_of,
    is_fault_reset,
    leave_ramp,
    next_state,
    quick_stop_plan,
    stop_ramp,
)
from gantryctl.drives.virtual.axis.hardware import Hardware
from gantryctl.drives.virtual.axis.plant import DrivePlant
from gantryctl.drives.virtual.axis.power_stage import Event, Phase, PowerStage
from gantryctl.drives.virtual.axis.speed_reference import SpeedReference
from gantryctl.drives.virtual.communication.dictionary import Dictionary
from gantryctl.drives.virtual.communication.emergency import Emergency
from gantryctl.drives.virtual.personality import Personality

# Error codes of CiA 402: DC link undervoltage; load level warning.
UNDERVOLTAGE: Final = 0x3220
LOAD_WARNING: Final = 0x2351
ENABLE_WORD: Final = 0x0F
_PLAIN_ENABLE: Final = 0x8F
_FAULTY: Final = (State.FAULT, State.FAULT_REACTION)


class DriveAxis:
    """Drive axis; `tick` is one period of its state machine and of everything behind it.

    Args:
        hardware: name plates.
        od: option codes, brake times, limits.
        plant: the plant.
        reference: speed reference of the enabled drive.
        emergency: takes its errors.
        kind: quirks.
        faults: injected faults.
    """

    def __init__(
        self,
        hardware: Hardware,
        od: Dictionary,
        plant: DrivePlant,
        reference: SpeedReference,
        emergency: Emergency,
        kind: Personality,
        faults: Faults,
    ) -> None:
        self._od, self.plant, self.reference = od, plant, reference
        self.stage = PowerStage(hardware, od, plant, reference)
        self._emergency, self._kind, self._faults = emergency, kind, faults
        self._output_bits, self._tick_us = hardware.output_bits, round(hardware.tick_s * 1e6)
        self.state = State.SWITCH_ON_DISABLED
        self._after: State | None = None
        self._quick_stop_ticks = 0
        self.reset()

    def reset(self) -> None:
        """State after power on: no torque, brake closed, transitions 0 and 1 done."""
        self.controlword = 0
        self.commanded = False
        """A controlword has been received since the reset."""
        self.error_code = 0
        self.overload_warning = False
        # A quick stop by lost communication: the enable command that still stands does not end it, a new one does.
        self._own_stop = False
        self.shows_fault = False
        """6041 shows Fault whatever the state is: a lie."""
        self.reference.reset()
        self._off(State.SWITCH_ON_DISABLED)

    @property
    def power_ok(self) -> bool:
        """Mains are on and no safe torque off is requested."""
        return self._faults.powered and self.plant.cabinet.watchdog_closed

    # --- what comes from outside -------------------------------------------------------------------------------

    def control(self, word: int) -> None:
        """Obey a new controlword (6040), one transition at most."""
        previous, self.controlword = self.controlword, word
        self.commanded = True
        if word != previous:
            self.shows_fault = self.stage.brake_held_open = False
        if is_fault_reset(previous, word) and not self._faults.stuck_state:
            self._reset_fault()
        self._obey()

    def limit_torque(self, torque_nm: float) -> None:
        """Apply 6072."""
        if not self._kind.torque_limit_ignored:
            self.plant.limit_torque(torque_nm)

    def communication_lost(self, code: int) -> None:
        """React as 6007 says to a lost heartbeat, a missed RPDO deadline or an NMT stop; without torque, do nothing."""
        if not self.stage.energised or self.state in _FAULTY or self._goes_on():
            return
        self.stage.brake_held_open = self._kind.brake_open_in_silence
        match AbortConnection(self._od.number(0x6007)):
            case AbortConnection.NOTHING:
                pass
            case AbortConnection.FAULT:
                self.fault(code, report=False)
            case AbortConnection.DISABLE_VOLTAGE:
                self._off(State.SWITCH_ON_DISABLED)
            case AbortConnection.QUICK_STOP:
                if self.state is State.ENABLED:
                    self._own_stop = self._quick_stop()
                elif self.state is not State.QUICK_STOP:
                    self._off(State.SWITCH_ON_DISABLED)

    def _goes_on(self) -> bool:
        """A drive that lies takes note of lost communication, and nothing more."""
        kind = self._kind
        self.shows_fault = self.shows_fault or kind.fault_shown_only
        turning = kind.silence_obeyed_at_rest_only and not self.reference.at_rest
        return kind.silence_emcy_only or kind.fault_shown_only or turning

    def fault(self, code: int, *, report: bool = True, ramp: bool = True) -> None:
        """Transition 13.

        Args:
            code: error code, 603F.
            report: send an EMCY; False where another part has already done so.
            ramp: the power stage can still brake.
        """
        if report and not self._kind.silent_faults:
            self._emergency.raise_error(code)
        if self.state in _FAULTY:
            return
        self.error_code = 0 if self._kind.silent_faults else code
        reaction = stop_ramp(self._od.number(0x605E))
        if not ramp or reaction is Ramp.NONE or self.stage.phase in (Phase.OFF, Phase.STARTING):
            self._off(State.FAULT)
            return
        self.state = State.FAULT_REACTION
        self._stop(reaction, State.FAULT)

    def leave_by_itself(self) -> None:
        """Go to Switch on disabled without a command and without a fault (side channel)."""
        self._off(State.SWITCH_ON_DISABLED)

    # --- one tick ----------------------------------------------------------------------------------------------

    def tick(self) -> None:
        """Supervision, at most one transition by command, then power stage, brake and plant."""
        self._work_outputs()
        self._supervise()
        self._obey()
        self._quirk_of_quick_stop()
        event = self.stage.advance()
        if event is Event.READY:
            self.state = State.ENABLED
        elif event is Event.STOPPED:
            self._off(self._after or State.SWITCH_ON_DISABLED)
        self.stage.apply(self.controlword, coasting=self.state is State.QUICK_STOP)

    def _work_outputs(self) -> None:
        """Hand the bits of 60FE to what is wired to them; a drive in fault takes its outputs back."""
        cabinet = self.plant.cabinet
        if self._output_bits:
            word = self._od.number(0x60FE, 1) & self._od.number(0x60FE, 2)
            if self.state is State.FAULT:
                word = 0
            cabinet.take({name: bool(word >> bit & 1) for name, bit in self._output_bits})
        cabinet.advance(self._tick_us)

    def _supervise(self) -> None:
        if not self.power_ok:
            if self.stage.energised and not self._faults.mains_ready:
                self.fault(UNDERVOLTAGE, ramp=False)
                self._off(State.FAULT)
            elif self.stage.energised or self.state is State.SWITCHED_ON:
                self._off(State.FAULT if self.state in _FAULTY else State.SWITCH_ON_DISABLED)
        # 2101:02 is the warning level of this drive, per mille of the I2t budget; EMCY 2351 is a warning only.
        loaded = 1000.0 * self.plant.overload >= self._od.number(0x2101, 2)
        if loaded and not self.overload_warning:
            self._emergency.warn(LOAD_WARNING)
        self.overload_warning = loaded

    def _obey(self) -> None:
        word, kind = self.controlword, self._kind
        if self._faults.stuck_state:
            return
        enabled = self.state is State.ENABLED and self.stage.phase is Phase.RUNNING
        # Nearly every tick of an enabled drive ends here.
        if enabled and word & _PLAIN_ENABLE == ENABLE_WORD:
            return
        if word & FAULT_RESET_BIT:
            if kind.reset_by_level:
                self._reset_fault()
            if kind.frozen_while_reset:
                return
        command = command_of(word)
        self._own_stop = self._own_stop and command is Command.ENABLE
        if self._own_stop:
            return
        if command is Command.QUICK_STOP and kind.quick_stop_ignored:
            return
        if command is Command.ENABLE and kind.needs_switch_on and self.state is State.READY:
            return
        stays = self.state is State.QUICK_STOP and quick_stop_plan(self._od.number(0x605A)).stay
        self._go(next_state(self.state, command, self.power_ok, stays))

    def _go(self, target: State) -> None:
        """Leave the present state for another, as the option codes say."""
        match self.state, target:
            case State.SWITCHED_ON, State.ENABLED:
                if self.stage.phase is Phase.OFF and (self.stage.start() or self._kind.enabled_before_brake):
                    self.state = State.ENABLED
            case State.ENABLED, State.ENABLED:
                # 0F while the drive still ramps down revokes the shutdown or the disable operation.
                if self.stage.phase is Phase.STOPPING:
                    self._run()
            case State.ENABLED, State.QUICK_STOP:
                self._quick_stop()
            case State.ENABLED, State.READY:
                self._leave(target, leave_ramp(self._od.number(0x605B)))
            case State.ENABLED, State.SWITCHED_ON:
                self._leave(target, leave_ramp(self._od.number(0x605C)))
            case State.QUICK_STOP, State.ENABLED:
                self.reference.dead = self._kind.dead_after_quick_stop
                self._run()
            case _:
                if target is not self.state or self.stage.phase is Phase.STARTING:
                    self._off(target)

    # --- ways in and out ---------------------------------------------------------------------------------------

    def _run(self) -> None:
        self.state = State.ENABLED
        self._after = None
        self.stage.run()

    def _leave(self, target: State, ramp: Ramp) -> None:
        if ramp is Ramp.NONE or self.stage.phase is Phase.STARTING:
            self._off(target)
        elif self._after is not target:
            self._stop(ramp, target)

    def _quick_stop(self) -> bool:
        """Transition 11; False if the torque went off at once."""
        plan = quick_stop_plan(0 if self._kind.quick_stop_option_ignored else self._od.number(0x605A))
        if plan.ramp is Ramp.NONE or self.stage.phase is Phase.STARTING:
            self._off(State.SWITCH_ON_DISABLED)
            return False
        self.state = State.QUICK_STOP
        self._quick_stop_ticks = 0
        if not self._faults.quick_stop_off:
            self._stop(plan.ramp, None if plan.stay else State.SWITCH_ON_DISABLED)
        return True

    def _quirk_of_quick_stop(self) -> None:
        if self._kind.quick_stop_one_tick and self.state is State.QUICK_STOP:
            self._quick_stop_ticks += 1
            if self._quick_stop_ticks > 1:
                self._off(State.SWITCH_ON_DISABLED)

    def _stop(self, ramp: Ramp, after: State | None) -> None:
        """Ramp down, then enter `after`; None: stay energised."""
        self._after = after
        self.stage.stop(ramp, stay=after is None)

    def _off(self, target: State) -> None:
        """Torque off now, brake closed."""
        self.state = target
        self._after = None
        self.stage.off()

    def _reset_fault(self) -> None:
        """Transition 15, if the mains are on again."""
        if self.state is State.FAULT and self._faults.mains_ready:
            self.error_code = 0
            self._emergency.clear_faults()
            self._off(State.SWITCH_ON_DISABLED)
