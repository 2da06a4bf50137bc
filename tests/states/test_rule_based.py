"""Operator, drive and faults together on the plant, in any order: rules for what may happen, an oracle for the rest.

The oracle (`gantryctl.engineering.faults.oracle`) looks at the true plant every millisecond and at every command on the
wire, and holds INV-1 to INV-7 for every sequence that the rules make.
"""

from __future__ import annotations

from contextlib import ExitStack
from functools import cache
from typing import Any, Final

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from gantryctl.drives.simulated import SimDrive
from gantryctl.engineering.faults.oracle.taps import Oracle, watching
from gantryctl.image import EncoderFlag, Mode, OperatorCommand
from gantryctl.machine import Machine, default_machine, with_values
from gantryctl.program import AxisState, GantryProgram
from gantryctl.runtime import FixedOperator
from gantryctl.units import deg, rad
from gantryctl.wiring.engine import build_engine
from gantryctl.wiring.simulator import sim_drive

# One standing fault at a time, each with a value that is not sound.
FAULTS: Final[tuple[tuple[str, Any], ...]] = (
    ("encoder_gain", 0.0),
    ("encoder_gain", -1.0),
    ("encoder_flags", int(EncoderFlag.ALARM)),
    ("no_torque", True),
    ("stuck_state", True),
    ("brake_feedback", True),
    ("estop_ok", False),
    ("mains_ready", False),
    ("collision_ok", False),
    ("door_ok", False),
    ("limit_plus_ok", False),
    ("enabling_switch", False),
    ("trip", 0x8611),
)
SOUND: Final = {"encoder_gain": 1.0, "encoder_flags": 0, "brake_feedback": None, "limit_plus_ok": None}
# The position that a fault of the encoder leaves behind is another one; the next power-up must not trust it.
_LEFT_BEHIND: Final = ("encoder_gain",)


@cache
def machine(scan_ms: float) -> Machine:
    return with_values(default_machine(), {"control.scan_period_ms": scan_ms, "speed.setting_max_deg_s": 6.0})


class AxisUnderRules(RuleBasedStateMachine):
    """One axis, its operator, and whatever breaks."""

    def __init__(self) -> None:
        super().__init__()
        self.watched = ExitStack()
        self.oracle = self.watched.enter_context(watching(Oracle()))
        self.fault: str | None = None

    @initialize(
        scan_ms=st.sampled_from([1.0, 4.0, 10.0]), angle_deg=st.sampled_from([0.0, 90.0, -90.0, 150.0])
    )
    def new_axis(self, scan_ms: float, angle_deg: float) -> None:
        model = machine(scan_ms)
        self.drive = sim_drive(model, angle_deg)
        assert isinstance(self.drive, SimDrive)
        self.operator = FixedOperator(OperatorCommand(mode=Mode.CONTINUOUS, speed_rad_s=rad(0.6)))
        self.engine = build_engine(model, drive=self.drive, operator=self.operator)
        program = self.engine.program
        assert isinstance(program, GantryProgram)
        program.service = True
        self.axis = program.axis
        self.engine.run_for(0.05)

    def teardown(self) -> None:
        self.watched.close()

    # --- the operator ---------------------------------------------------------------------------------

    def levels(self, **levels: object) -> None:
        self.operator.command = self.operator.command._replace(**levels)

    def pulse(self, name: str, **levels: object) -> None:
        self.levels(**{name: True}, **levels)
        self.engine.run_for(2 * self.engine.period_s)
        self.levels(**{name: False})

    @rule()
    def switch_on(self) -> None:
        self.levels(power=False)
        self.engine.run_for(self.engine.period_s)
        self.levels(power=True)
        self.engine.run_until(lambda _: self.axis.state is AxisState.STANDSTILL, 1.5)

    @rule()
    def switch_off(self) -> None:
        self.levels(power=False)
        self.engine.run_for(0.1)

    @rule(by_deg=st.sampled_from([-20.0, -1.0, 0.5, 20.0]), speed_deg_s=st.sampled_from([0.6, 3.0, 6.0]))
    def move(self, by_deg: float, speed_deg_s: float) -> None:
        target = self.axis.virtual.pos_ref_rad + rad(by_deg)
        self.pulse("move", target_rad=target, speed_rad_s=rad(speed_deg_s))

    @rule(
        forward=st.booleans(),
        renewals=st.integers(0, 30),
        released=st.booleans(),
        speed_deg_s=st.sampled_from([0.6, 3.0]),
    )
    def hold_a_key(self, forward: bool, renewals: int, released: bool, speed_deg_s: float) -> None:
        """Held for a while; let go, or the connection breaks while it is held."""
        self.levels(forward=False, reverse=False)
        self.engine.run_for(self.engine.period_s)
        self.levels(forward=forward, reverse=not forward, speed_rad_s=rad(speed_deg_s))
        for _ in range(renewals + 1):
            self.levels(lease=self.operator.command.lease + 1)
            self.engine.run_for(0.03)
        if not released:
            self.engine.run_for(0.3)
        self.levels(forward=False, reverse=False)

    @rule(override=st.sampled_from([0.0, 0.3, 1.0]))
    def override(self, override: float) -> None:
        self.levels(override=override)

    @rule(name=st.sampled_from(["halt", "stop", "quick_stop", "reset"]))
    def press(self, name: str) -> None:
        self.pulse(name)

    @rule(seconds=st.sampled_from([0.02, 0.2, 1.0]))
    def wait(self, seconds: float) -> None:
        self.engine.run_for(seconds)

    # --- faults ---------------------------------------------------------------------------------------

    @precondition(lambda self: self.fault is None)
    @rule(fault=st.sampled_from(FAULTS))
    def break_something(self, fault: tuple[str, Any]) -> None:
        name, value = fault
        self.fault = name
        if name == "trip":
            self.drive.trip(value)
        else:
            setattr(self.drive.faults, name, value)
        self.engine.run_for(0.1)

    @precondition(lambda self: self.fault is not None and self.fault not in _LEFT_BEHIND)
    @rule()
    def mend_it(self) -> None:
        assert self.fault is not None
        if self.fault != "trip":
            setattr(self.drive.faults, self.fault, SOUND.get(self.fault, self._sound(self.fault)))
        self.fault = None
        self.engine.run_for(0.1)

    @staticmethod
    def _sound(name: str) -> object:
        return name not in ("no_torque", "stuck_state")

    # --- what must hold -------------------------------------------------------------------------------

    @invariant()
    def nothing_is_broken(self) -> None:
        assert not self.oracle.violations, "\n".join(map(str, self.oracle.violations))

    @invariant()
    def a_latched_axis_moves_nothing(self) -> None:
        if hasattr(self, "axis") and self.axis.alarms.first_out is not None:
            assert self.engine.output.vel_cmd_rad_s == 0.0
            assert self.axis.state is AxisState.ERROR_STOP

    @invariant()
    def within_the_travel(self) -> None:
        if hasattr(self, "axis"):
            assert abs(deg(self.drive.truth()[2] / 1144.0)) < 181.0


class TestAxisUnderRules(AxisUnderRules.TestCase):
    settings = settings(
        max_examples=25, stateful_step_count=15, deadline=None, suppress_health_check=list(HealthCheck)
    )
