"""What a command may ask for: roles, control, limits, age. The program judges the rest in its scan."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from gantryctl.image import Mode
from gantryctl.machine import Machine
from gantryctl.program import Code
from gantryctl.program.alarms.log import refusal
from gantryctl.service.protocol.limits import FRAME_S, FRAMES_MAX, FRAMES_MAX_JOG
from gantryctl.service.protocol.messages import Identity, Message, MessageRefused, action_of
from gantryctl.service.protocol.roles import NEEDS_AUTHORITY, Action, may
from gantryctl.units import deg, rad

if TYPE_CHECKING:
    from gantryctl.service.command.operator import ServiceOperator

_ACC_PART: Final = 0.1
"""The lowest acceleration setting as a part of that of the machine file."""
_NEW_MOTION: Final = frozenset({Action.POWER, Action.JOG, Action.MOVE, Action.BRAKE_TEST})
_NAMES: Final = {
    "speed_setting_deg_s": ("speed", "deg/s"),
    "increment_deg": ("increment", "deg"),
    "override_percent": ("override", "%"),
    "acc_setting_deg_s2": ("acceleration", "deg/s2"),
}


@dataclass
class Rules:
    """Limits of one machine, in degrees, and who may do what.

    Attributes:
        limits: lowest and highest value of every tag that can be set.
        start_s: monotonic time of status frame 0.
        lock: why power cannot be switched on, and no reset changes it: encoder or drive are not what they were; or "".
        held: why power cannot be switched on until a reset, or "".
        untestable: why the brake cannot be tested here, or "".
        locked: whether a reset now meets something locked.
        journal_keeps: whether the journal is able to keep events.
        acknowledge: marks an alarm row as seen; raises MessageRefused for a row that is not there.
    """

    limits: dict[str, tuple[float, float]]
    lease_s: float
    speed_rad_s: float
    increment_rad: float
    start_s: float
    lock: str = ""
    held: str = ""
    untestable: str = ""
    locked: Callable[[], bool] = field(default=lambda: False)
    journal_keeps: Callable[[], bool] = field(default=lambda: True)
    acknowledge: Callable[[int, Identity], None] = field(default=lambda _id, _who: None)

    @property
    def blocked_by(self) -> str:
        """Why power cannot be switched on, or ""."""
        return self.lock or self.held

    @staticmethod
    def rad(angle_deg: float) -> float:
        """Degrees of a message to radians."""
        return rad(angle_deg)

    def frame(self, now_s: float) -> int:
        """Status frame number at a monotonic time; the first is 1."""
        return int((now_s - self.start_s) / FRAME_S) + 1

    def check_age(self, message: Message, frame: int) -> None:
        """Refuse what was sent by somebody who saw an old picture."""
        most = FRAMES_MAX_JOG if message.kind in ("jog", "renew") else FRAMES_MAX
        behind = frame - message.frame
        if not 0 <= behind <= most:
            raise MessageRefused("SEC-02", f"status frame {message.frame} is {behind} behind, at most {most}")

    def check(self, operator: ServiceOperator, who: Identity, message: Message) -> None:
        """Role, control, and what the service knows better than the program.

        Raises:
            MessageRefused: with the reason.
        """
        action = action_of(message)
        if not may(who.role, action):
            raise MessageRefused("SEC-01", f"the role {who.role} may not do this ({action})")
        power_off = message.kind == "power" and not message.values["on"]
        needs_control = action in NEEDS_AUTHORITY and not power_off and message.kind != "arm"
        if needs_control and not operator.authority.holds(who):
            held = operator.authority.holder
            raise MessageRefused("SEC-07", f"{held.user} has control" if held else "take control first")
        begins = action in _NEW_MOTION and not power_off and message.kind not in ("renew", "arm")
        if begins or (action is Action.OVERRIDE and operator.program.axis.paused):
            self._check_motion(operator, who, message)
        if message.kind == "reset" and self.locked() and may(who.role, Action.RESET_LOCKED):
            operator.check_armed(Action.RESET_LOCKED, who)

    def _check_motion(self, operator: ServiceOperator, who: Identity, message: Message) -> None:
        """Whether anything new may begin."""
        if not (self.journal_keeps() and operator.events.room):
            raise MessageRefused(
                "JRN-02", "the journal cannot keep events now: no new motion; see `journal_state`"
            )
        if operator.shutdown:
            raise MessageRefused("SYS-07", "the service is being shut down")
        if message.kind in ("power", "brake_test") and self.blocked_by:
            raise MessageRefused(str(Code.PWR_04), self.blocked_by)
        if message.kind == "brake_test":
            self._check_brake_test(operator, who)
        wanted = {"jog": Mode.CONTINUOUS, "increment": Mode.INCREMENTAL}.get(message.kind)
        mode = operator.program.mode
        if wanted is not None and mode is not wanted and mode is not Mode.NONE:
            words = f"{message.kind} needs the mode {wanted.name.lower()}, it is {mode.name.lower()}"
            raise MessageRefused(str(Code.CTL_16), words)

    def _check_brake_test(self, operator: ServiceOperator, who: Identity) -> None:
        """A brake test where the brake can be kept closed, and armed."""
        if self.untestable:
            raise MessageRefused(str(Code.CTL_14), self.untestable)
        operator.check_armed(Action.BRAKE_TEST, who)

    @staticmethod
    def present(operator: ServiceOperator, tag: str) -> float:
        """One setting as it is, in the unit of its tag."""
        levels, virtual = operator.levels, operator.program.axis.virtual
        return {
            "speed_setting_deg_s": deg(levels.speed_rad_s),
            "increment_deg": deg(levels.increment_rad),
            "override_percent": levels.override * 100.0,
            "acc_setting_deg_s2": deg(virtual.acc_setting_rad_s2),
        }[tag]

    def apply(self, operator: ServiceOperator, tag: str, value: float) -> None:
        """Change one setting; refused outside its limits, never clamped."""
        low, high = self.limits[tag]
        name, unit = _NAMES[tag]
        if not low <= value <= high:
            allowed = f"within {low:.4g} and {high:.4g} {unit}"
            reason = refusal(Code.CTL_01, name=name, allowed=allowed, measured=f"{value:.6g} {unit}")
            raise MessageRefused(str(reason.code), reason.text)
        levels = operator.levels
        match tag:
            case "speed_setting_deg_s":
                operator.levels = levels._replace(speed_rad_s=rad(value))
            case "increment_deg":
                operator.levels = levels._replace(increment_rad=rad(value))
            case "override_percent":
                operator.levels = levels._replace(override=value / 100.0)
            case "acc_setting_deg_s2":
                axis = operator.program.axis
                refused = axis.set_acceleration(rad(value))
                if refused is not None:
                    raise MessageRefused(str(refused.code), refused.text)


def rules_of(
    machine: Machine, start_s: float, speed_rad_s: float | None, increment_rad: float | None
) -> Rules:
    """The rules of a machine file, with settings of the last run where they still fit."""
    speed, axis, virtual = machine.speed, machine.axis, machine.virtual_axis
    low, high = speed.setting_min_deg_s, speed.setting_max_deg_s
    travel = axis.pos_max_deg - axis.pos_min_deg
    kept = deg(speed_rad_s) if speed_rad_s is not None else low
    step = deg(increment_rad) if increment_rad is not None else 1.0
    return Rules(
        limits={
            "speed_setting_deg_s": (low, high),
            "increment_deg": (0.001, travel),
            "override_percent": (0.0, 100.0),
            "acc_setting_deg_s2": (_ACC_PART * virtual.acc_deg_s2, virtual.acc_deg_s2),
        },
        lease_s=machine.monitors.lease_ms * 1e-3,
        speed_rad_s=rad(min(max(kept, low), high)),
        increment_rad=rad(step if 0.001 <= step <= travel else 1.0),
        start_s=start_s,
    )
