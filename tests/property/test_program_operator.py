"""Whatever an operator does, and however the inputs fail: the set-point stays inside, the wire stays clean.

One level changes at a time, so that a refusal can be laid at its door: a refused command leaves the axis as it was.
"""

import math

from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, precondition, rule

from gantryctl.image import DigitalInputs, DriveRequest, Mode
from gantryctl.program import AxisState, PowerPhase
from gantryctl.units import rad
from support.examples import examples
from unit.program.rig import RATIO, Rig, settings

PERIOD_S = 0.004
CLAMP = rad(6.3) * RATIO
# A plan that ends exactly at a limit may pass it by rounding; less than one count of the encoder at the gantry.
ROUNDING = 1e-9
# Steepest ramp of the rig: the drive's own stop has no set-point; jog release is 5 deg/s2.
STEEPEST = rad(5.0)

bad_numbers = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 5e-324])
targets = st.one_of(
    st.floats(-180.0, 180.0).map(rad),
    st.sampled_from([0.0, 180.0, -180.0, 180.0001, -181.0, 200.0, 360.0]).map(rad),
    bad_numbers,
)
speeds = st.one_of(
    st.sampled_from([0.6, 3.0, 6.0]).map(rad), st.sampled_from([0.0, -1.0, 0.59, 6.01]).map(rad), bad_numbers
)
increments = st.one_of(
    st.floats(0.01, 20.0).map(rad), st.sampled_from([0.0, -1.0, 360.0, 361.0]).map(rad), bad_numbers
)
waits = st.sampled_from([0.004, 0.02, 0.1, 0.5, 2.0])
overrides = st.one_of(st.sampled_from([0.0, 1e-6, 0.3, 1.0, 1.0, -0.1, 1.1]), bad_numbers)


def follows(machine):
    """Whether the axis follows its set-point: where a command may do something."""
    return machine.rig is not None and machine.rig.axis.power.phase is PowerPhase.ON


class Operating(RuleBasedStateMachine):
    """A panel in the hands of somebody who presses everything."""

    def __init__(self):
        super().__init__()
        self.rig = None
        self.renewing = True

    @initialize(
        at_deg=st.one_of(
            st.sampled_from([0.0, 179.9, -179.9, 180.0, 180.3, -180.4]), st.floats(-180.0, 180.0)
        ),
        jerk=st.sampled_from([math.inf, 20.0]),
        powered=st.sampled_from([True, True, True, False]),
    )
    def start(self, at_deg, jerk, powered):
        self.rig = Rig(at_deg=at_deg, config=settings(period_s=PERIOD_S, jerk=jerk))
        if powered:
            self.change(power=True)
            self.run(1.0)
            assert self.rig.axis.state is AxisState.STANDSTILL
            self.change(mode=Mode.CONTINUOUS)

    # --- what can be pressed ----------------------------------------------------------------------

    @rule(
        level=st.sampled_from(["forward", "reverse", "move", "halt", "stop", "reset", "power"]),
        value=st.booleans(),
    )
    def press(self, level, value):
        self.change(**{level: value})

    @rule(really=st.integers(0, 5))
    def quick_stop(self, really):
        if really == 0:
            self.change(quick_stop=True)
            self.change(quick_stop=False)

    @precondition(follows)
    @rule(key=st.sampled_from(["forward", "reverse"]), speed=st.sampled_from([0.6, 6.0]), seconds=waits)
    def jog(self, key, speed, seconds):
        """A whole press: mode, speed, key, and time; it may be left pressed."""
        self.renewing = True
        self.change(forward=False)
        self.change(reverse=False)
        self.change(mode=Mode.CONTINUOUS)
        self.change(speed_rad_s=rad(speed))
        self.change(**{key: True})
        self.run(seconds)

    @precondition(follows)
    @rule(key=st.sampled_from(["forward", "reverse"]), increment=increments, seconds=waits)
    def inch(self, key, increment, seconds):
        self.change(forward=False)
        self.change(reverse=False)
        self.change(mode=Mode.INCREMENTAL)
        self.change(speed_rad_s=rad(6.0))
        self.change(increment_rad=increment)
        self.change(**{key: True})
        self.run(seconds)

    @precondition(follows)
    @rule(angle=targets, speed=st.sampled_from([0.6, 6.0]), seconds=waits)
    def move(self, angle, speed, seconds):
        self.change(move=False)
        self.change(target_rad=angle)
        self.change(speed_rad_s=rad(speed))
        self.change(move=True)
        self.run(seconds)

    @rule(mode=st.sampled_from(Mode))
    def choose_mode(self, mode):
        self.change(mode=mode)

    @rule(speed=speeds)
    def set_speed(self, speed):
        self.change(speed_rad_s=speed)

    @rule(increment=increments)
    def set_increment(self, increment):
        self.change(increment_rad=increment)

    @rule(override=overrides)
    def set_override(self, override):
        self.change(override=override)

    @rule(renewing=st.booleans())
    def lease(self, renewing):
        self.renewing = renewing

    @rule(
        name=st.sampled_from([*DigitalInputs._fields]),
        value=st.sampled_from([True] * 9 + [False]),
    )
    def wire(self, name, value):
        self.rig.drive.inputs = self.rig.drive.inputs._replace(**{name: value})
        self.step()

    @rule(seconds=waits)
    def wait(self, seconds):
        self.run(seconds)

    @precondition(lambda self: self.rig is not None and self.rig.axis.state is AxisState.ERROR_STOP)
    @rule()
    def recover(self):
        """What a person does after a stop: wait, release everything, reset, switch on."""
        self.rig.drive.inputs = DigitalInputs()
        self.run(4.0)
        for level in ("forward", "reverse", "move", "halt", "stop", "reset", "power"):
            self.change(**{level: False})
        self.change(reset=True)
        self.run(0.1)
        self.change(reset=False)
        self.change(power=True)
        self.run(1.2)
        assert self.rig.axis.power.phase is PowerPhase.ON

    # --- one scan, looked at ------------------------------------------------------------------------

    def change(self, **level):
        rig = self.rig
        if self.renewing:
            rig.operator = rig.operator._replace(lease=rig.operator.lease + 1)
        rig.operator = rig.operator._replace(**level)
        refusals, plan, state = rig.axis.refusal_count, rig.axis.virtual.plan, rig.axis.state
        following = rig.axis.virtual.following
        self.step()
        if rig.axis.refusal_count > refusals and state is not AxisState.ERROR_STOP and not rig.codes:
            released = "power" in level or level.get("forward") is False or level.get("reverse") is False
            both = rig.operator.forward and rig.operator.reverse
            reversed_ = rig.axis.refusal.text.startswith("reversal")
            if following and rig.axis.virtual.following and not (released or both or reversed_):
                assert rig.axis.virtual.plan is plan, f"{level}: {rig.axis.refusal}"

    def run(self, seconds):
        rig = self.rig
        for k in range(math.ceil(seconds / PERIOD_S)):
            if self.renewing and k % 8 == 0:
                rig.operator = rig.operator._replace(lease=rig.operator.lease + 1)
            self.step()

    def step(self):
        rig, virtual = self.rig, self.rig.axis.virtual
        before = (virtual.following, virtual.pos_ref_rad, virtual.vel_ref_rad_s)
        rig.step()
        output, axis = rig.output, rig.axis
        assert -CLAMP <= output.vel_cmd_rad_s <= CLAMP, "finite and within the clamp"
        assert -385.0 <= output.torque_ff_nm <= 385.0
        if axis.power.phase is not PowerPhase.ON:
            assert output.vel_cmd_rad_s == 0.0, "no speed unless power is on"
            assert virtual.vel_ref_rad_s == 0.0
        if output.request is not DriveRequest.ENABLE:
            assert output.vel_cmd_rad_s == 0.0
        if output.brake_open:
            assert output.request is not DriveRequest.DISABLE
        self.moves_for_a_reason(axis)
        if before[0] and virtual.following:
            self.set_point_is_smooth(before, virtual)

    def moves_for_a_reason(self, axis):
        motion = axis.motion
        if axis.virtual.vel_ref_rad_s != 0.0:
            assert motion.current is not None or motion.stop_command is not None or motion.switching_off
            assert axis.state is not AxisState.ERROR_STOP
            assert axis.state is not AxisState.DISABLED

    def set_point_is_smooth(self, before, virtual):
        _, pos, vel = before
        assert abs(virtual.vel_ref_rad_s - vel) <= STEEPEST * PERIOD_S * (1.0 + 1e-6)
        assert abs(virtual.pos_ref_rad - pos) <= rad(6.0) * PERIOD_S * (1.0 + 1e-6) + ROUNDING
        # Inside, or, from outside, never further out.
        limit = max(rad(180.0), abs(pos)) + ROUNDING
        assert abs(virtual.pos_ref_rad) <= limit

    @invariant()
    def speed_setting_is_kept(self):
        if self.rig is not None:
            assert abs(self.rig.axis.virtual.vel_ref_rad_s) <= rad(6.0) * (1.0 + 1e-9)


TestOperating = Operating.TestCase
TestOperating.settings = hypothesis_settings(max_examples=examples(60), stateful_step_count=40)
