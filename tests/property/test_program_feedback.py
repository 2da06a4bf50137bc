"""Whatever a drive reports: no exception in the scan, a clean wire, and a stop that stays a stop."""

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, EncoderFlag
from gantryctl.program import AxisState, PowerPhase
from gantryctl.units import rad
from support.examples import examples
from unit.program.rig import RATIO, Rig
from unit.program.rig import settings as axis_settings

CLAMP = rad(6.3) * RATIO
numbers = st.one_of(
    st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e300, 0.0, 1e-310]), st.floats(-2000.0, 2000.0)
)
readings = st.fixed_dictionaries(
    {},
    optional={
        "state": st.sampled_from(DriveState),
        "pos_act_counts": st.one_of(st.integers(-(2**63), 2**63), st.integers(0, 2**33), st.just(math.nan)),
        "vel_act_rad_s": numbers,
        "torque_act_nm": numbers,
        "brake_open": st.booleans(),
        "torque_limited": st.booleans(),
        "overload": numbers,
        "encoder": st.sampled_from([EncoderFlag(k) for k in range(8)]),
        "error_code": st.integers(0, 0xFFFF),
        "warning": st.booleans(),
        "age_scans": st.integers(0, 50),
        "inputs": st.builds(DigitalInputs, *[st.booleans()] * 5, *[st.none() | st.booleans()] * 3),
    },
)
# Most scans are good: several faults in a row at random times, not noise from the first scan on.
spells = st.lists(st.tuples(st.integers(0, 60), st.integers(1, 12), readings), min_size=1, max_size=4)


def clean(rig):
    output, power = rig.output, rig.axis.power
    assert -CLAMP <= output.vel_cmd_rad_s <= CLAMP
    assert -385.0 <= output.torque_ff_nm <= 385.0
    assert isinstance(output.request, DriveRequest)
    if power.phase is not PowerPhase.ON or output.request is not DriveRequest.ENABLE:
        assert output.vel_cmd_rad_s == 0.0
    if rig.first is not None:
        assert output.vel_cmd_rad_s == 0.0, "a latched stop never commands a speed"
        assert rig.first.text


def play(rig, script):
    """Run good scans and spoilt ones in turn."""
    for good, bad, reading in script:
        rig.spoil = None
        for _ in range(good):
            rig.step()
            clean(rig)
        rig.spoil = lambda drive, reading=reading: drive._replace(**reading)
        for _ in range(bad):
            rig.step()
            clean(rig)
    rig.spoil = None
    latched = rig.first is not None
    for _ in range(50):
        rig.step()
        clean(rig)
        if latched:
            assert rig.axis.state is AxisState.ERROR_STOP, "the cause is gone, the stop stays"


@settings(max_examples=examples(150))
@given(spells, st.sampled_from([0.0, 0.05, 0.15, 0.4, 0.8, 1.6]))
def test_any_reading_in_any_phase(script, seconds):
    """From switching on to the middle of a move."""
    rig = Rig(config=axis_settings(period_s=0.004))
    rig.op(power=True)
    rig.run(seconds)
    rig.move(60.0)
    rig.run(0.1)
    play(rig, script)


@settings(max_examples=examples(60))
@given(spells, spells)
def test_any_reading_through_a_reset(script, again):
    rig = Rig(config=axis_settings(period_s=0.004))
    rig.program.service = True
    rig.op(power=True)
    rig.run(1.2)
    rig.move(60.0)
    play(rig, script)
    rig.run(4.0)
    rig.op(power=False, reset=True)
    rig.run(1.1)
    rig.op(reset=False)
    rig.op(power=True)
    play(rig, again)


@settings(max_examples=examples(100))
@given(readings)
def test_a_first_reading_of_any_kind(reading):
    rig = Rig(config=axis_settings(period_s=0.004))
    rig.spoil = lambda drive: drive._replace(**reading)
    rig.op(power=True)
    for _ in range(400):
        rig.step()
        clean(rig)
