"""The power sequence: from torque off behind a closed brake to a held load, and back."""

from __future__ import annotations

from typing import Final, assert_never

from gantryctl.image import DriveState
from gantryctl.program.alarms.codes import Reaction
from gantryctl.program.power.phases import FALLING, RISING, TORQUE_ON, PowerPhase
from gantryctl.program.power.power_up import WayUp

_OPERATION_ENABLED: Final = DriveState.OPERATION_ENABLED
_ENABLED: Final = (_OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_ON: Final = PowerPhase.ON
_BRAKE_OPENING: Final = (PowerPhase.RELEASING, PowerPhase.SAG_WATCH)


class PowerSequence(WayUp):
    """Drive enable, torque proof, brake, and the same back, one phase at a time (table in `PowerPhase`).

    The proof: `torque_ff_nm` is raised to the proof torque against the closed brake, and the actual torque
    must follow. Then it goes to the preload, the torque that held the load last time, and the brake opens.
    From there the preload stays as it is while power is on: the drive adds it to its own loop, whose
    integrator carries the difference, so nothing ever steps. Going down, the brake closes first; then
    `torque_ff_nm` is lowered in three steps by what the motor still gives, with a look at the angle after
    each: a brake that slips gets the torque back (HOLD).

    Attributes:
        phase: where the sequence is.
        status: Power.Status: TRUE from ON until it goes down, also while the brake holds at standstill.
        proof: whether torque was proven before the last release.
        request, brake_open, torque_ff_nm: what it says to the drive.
        holding_torque_nm: mean torque at standstill, motor side: retained memory, and the next preload.
        testing: a brake test is under way.
        brake_test: its law. brake_test_result, brake_tests: the last test that has ended, and how many did.
        fault_reset: ask the drive to clear its fault (Reset); only while off.
    """

    __slots__ = ()

    def switch_on(self) -> None:
        """Begin the way up; only from OFF."""
        if self.phase is PowerPhase.OFF:
            self._enter(PowerPhase.ENABLING)

    def switch_off(self) -> None:
        """Begin the way down; the axis has come to rest."""
        self._parking = False
        self.status = False
        if self.phase is _ON or self.phase in _BRAKE_OPENING:
            self._enter(PowerPhase.CLOSING)
        elif self.phase in RISING:
            self._enter(PowerPhase.DISABLING)
        elif self.phase is PowerPhase.PARKED:
            self._enter(PowerPhase.OFF)

    def park(self) -> None:
        """Let the brake hold; `status` stays TRUE."""
        if self.phase is _ON:
            self._parking = True
            self._enter(PowerPhase.CLOSING)

    def wake(self) -> None:
        """A motion is wanted: open the brake again, through the same proof."""
        if self.phase is PowerPhase.PARKED:
            self._enter(PowerPhase.ENABLING)

    def react(self, reaction: Reaction) -> None:
        """Do what an alarm of class QUICK_STOP, TORQUE_OFF or HOLD asks for."""
        self.status = False
        self._parking = False
        if self.testing:
            self._test_stopped(reaction)
        if self.phase is PowerPhase.TORQUE_OFF or (
            self.phase is PowerPhase.HOLDING and reaction is not Reaction.TORQUE_OFF
        ):
            return
        if reaction is Reaction.HOLD and self._can_hold():
            self._enter(PowerPhase.HOLDING)
        elif self.phase in (PowerPhase.OFF, PowerPhase.PARKED):
            self._enter(PowerPhase.OFF)
        elif reaction is not Reaction.QUICK_STOP:
            self._enter(PowerPhase.TORQUE_OFF)
        elif self.phase is _ON or self.phase in _BRAKE_OPENING:
            self._enter(PowerPhase.QUICK_STOPPING)
        elif self.phase in RISING:
            self._enter(PowerPhase.DISABLING)

    def release_hold(self) -> None:
        """Service has reset HOLD: try the brake again."""
        if self.phase is PowerPhase.HOLDING:
            self._enter(PowerPhase.CLOSING)

    def rebase(self) -> None:
        """The position was set anew: what the slip watch compares with moves along."""
        self._pos_hold = self._pos_rad = None

    def learn(self) -> None:
        """At standstill on the servo: follow the torque that holds the load."""
        mean = self.holding_torque_nm
        self.holding_torque_nm = self._limited(mean + (self._feedback.torque_nm - mean) * self._learn)

    def _enter(self, phase: PowerPhase) -> None:
        super()._enter(phase)
        if phase is PowerPhase.OFF and self.testing:
            self._end_test()

    @property
    def parked(self) -> bool:
        """`status` is TRUE, but the brake holds the axis, or is being opened or closed."""
        return self.status and self.phase is not _ON

    @property
    def falling(self) -> bool:
        """A stop or the way down is under way; nothing may shorten it."""
        return self.phase in FALLING

    def step(self, pos_rad: float) -> None:  # noqa: C901  one row per phase
        """One scan, at most one change of phase."""
        self._pos_rad = pos_rad
        phase = self.phase
        if phase is _ON:
            if self._feedback.state is not _OPERATION_ENABLED:
                self._lost()
            return
        self._count += self._feedback.periods
        if phase in TORQUE_ON and self._feedback.state not in _ENABLED:
            self._lost()
            return
        match phase:
            case PowerPhase.OFF | PowerPhase.PARKED:
                self._off(pos_rad)
            case PowerPhase.ENABLING:
                self._enabling()
            case PowerPhase.PROVING:
                self._proving(pos_rad)
            case PowerPhase.SETTLING:
                self._settling()
            case PowerPhase.RELEASING:
                self._releasing(pos_rad)
            case PowerPhase.SAG_WATCH:
                self._sag_watch(pos_rad)
            case PowerPhase.CLOSING:
                self._closing()
            case PowerPhase.UNLOADING:
                self._unloading(pos_rad)
            case PowerPhase.DISABLING:
                self._disabling()
            case PowerPhase.QUICK_STOPPING:
                self._quick_stopping()
            case PowerPhase.TORQUE_OFF:
                self._torque_off()
            case PowerPhase.HOLDING:
                self._holding()
            case PowerPhase.TESTING:
                self._test_step(pos_rad)
            case _:
                assert_never(phase)
