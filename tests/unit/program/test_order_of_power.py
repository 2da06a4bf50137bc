"""Order of brake and torque, by the outputs of the program on an ideal drive."""

import math

import pytest

from gantryctl.image import DigitalInputs, DriveRequest, DriveState, LinkFlag
from gantryctl.program.alarms.codes import Code, Reaction
from gantryctl.program.alarms.words import Words
from gantryctl.program.power.phases import FALLING, OUTPUTS, RISING, TORQUE_ON, Proof
from gantryctl.units import rad
from unit.program.parts import BOTH, PERIODS, in_scans
from unit.program.power_steps import P, held_again, slip
from unit.program.rig import RATIO, Rig, moving_rig, powered, settings

approx = pytest.approx
LOAD = {"measured": 1.0, "limit": 1.0, "torque": 1.0}


class OwnBrake(Rig):
    """A drive that opens its brake itself as soon as it is enabled, and closes it when it is not."""

    def __init__(self):
        super().__init__(config=settings(brake_by_drive=True))
        self.spoil = lambda drive: drive._replace(brake_open=drive.state is DriveState.OPERATION_ENABLED)


OPEN = {P.RELEASING, P.SAG_WATCH, P.ON, P.QUICK_STOPPING}
OFF = {P.OFF, P.DISABLING, P.PARKED, P.TORQUE_OFF}
KEEPS = {P.CLOSING, P.UNLOADING, P.TORQUE_HOLD}
UP = {P.ENABLING, P.PROVING, P.SETTLING, P.RELEASING, P.SAG_WATCH, P.TESTING}
DOWN = {P.CLOSING, P.UNLOADING, P.DISABLING, P.QUICK_STOPPING, P.TORQUE_OFF}


@pytest.mark.parametrize("phase", P)
def test_what_each_phase_says_to_the_drive(phase):
    row = OUTPUTS[phase]
    assert row.brake_open is (phase in OPEN)
    assert (row.request is DriveRequest.DISABLE) is (phase in OFF)
    assert (row.request is None) is (phase in KEEPS)
    assert (row.request is DriveRequest.QUICK_STOP) is (phase is P.QUICK_STOPPING)
    assert (phase in RISING, phase in FALLING) == (phase in UP, phase in DOWN)
    # Without torque, or before it: the drive need not be enabled there. HOLD asks for it first.
    assert (phase in TORQUE_ON) is (phase not in OFF | {P.ENABLING, P.TORQUE_HOLD})


def test_a_new_axis_is_off_and_proves_nothing():
    power = Rig().axis.power
    assert (power.phase, power.proof, power.status, power.brake_open) == (P.OFF, Proof.NOT_DONE, False, False)
    assert (power.request, power.torque_ff_nm, power.fault_reset) == (DriveRequest.DISABLE, 0.0, False)
    assert not power.brake_test.under_way


def cycle(rig, **stop):
    """Up, a move, and down: the outputs of every scan."""
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.ON)
    rig.move(5.0)
    rig.run(1.0)
    rig.op(**stop)
    for _ in range(4000):
        rig.step()
        yield rig


@pytest.mark.parametrize("stop", [{"power": False}, {"quick_stop": True}])
def test_the_brake_is_closed_in_every_scan_before_the_drive_is_disabled(stop):
    rig = Rig(config=settings(holding_torque_nm=12.0))
    for scan in cycle(rig, **stop):
        off = scan.output.request is DriveRequest.DISABLE
        assert not (off and (scan.output.brake_open or scan.image.drive.brake_open))
        assert off or scan.image.drive.state in (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
    assert rig.axis.is_off


@PERIODS
@pytest.mark.parametrize("way", ["up", "down", "down by itself", "release"])
def test_a_drive_or_a_brake_that_does_not_follow_is_told_in_the_scan_after_its_time(period_s, way):
    """2 s to be enabled; 100 ms to open, and 300 ms for the contact.

    To be disabled 200 ms; of a drive that closes its brake by itself 350 ms from the way down on, whose first scan has
    begun that: in the scan after them it is told to take its torque off.
    """
    rig = Rig(config=settings(period_s=period_s, brake_by_drive=way == "down by itself"))
    rig.run(2.0 * period_s)
    if way.startswith("down"):
        rig.power_up()
        rig.op(power=False)
        rig.until(lambda: rig.axis.power.phase is P.DISABLING)
        rig.spoil = lambda drive: drive._replace(state=DriveState.OPERATION_ENABLED)
    else:
        shut = {"state": DriveState.READY_TO_SWITCH_ON} if way == "up" else {"brake_open": False}
        rig.spoil = lambda drive: drive._replace(**shut)
        rig.op(power=True)
        rig.until(lambda: rig.axis.power.phase is (P.ENABLING if way == "up" else P.RELEASING))
    start = rig.scan
    rig.until(lambda: bool(rig.codes), 3.0)
    release_s = in_scans(0.1, period_s) + in_scans(0.3, period_s)
    limit_s = {
        "up": 2.0,
        "down": in_scans(0.2, period_s) - period_s,
        "down by itself": in_scans(0.35, period_s) - 2.0 * period_s,
        "release": release_s,
    }[way]
    assert (rig.scan - start) * period_s == approx(limit_s + period_s)
    assert rig.codes == (["BRK-01"] if way == "release" else ["DRV-03"])


@pytest.mark.parametrize(
    ("stop", "stops"), [("quick stop", 0), ("torque off", 1), ("closed", 0), ("power off", 0)]
)
def test_a_stop_by_the_brake_is_one_from_which_the_torque_goes_with_the_brake_open(stop, stops):
    rig = moving_rig()
    if stop == "quick stop":
        rig.op(quick_stop=True)
    elif stop == "power off":
        rig.op(power=False)
    else:
        if stop == "closed":
            rig.spoil = lambda drive: drive._replace(brake_open=False)
        rig.drive.inputs = DigitalInputs(estop_ok=False)
    rig.run(3.0)
    assert rig.axis.is_off
    assert rig.axis.power.wear.stops == stops


def test_a_brake_that_slips_while_a_fault_is_being_reset_gets_torque():
    """The drive shows no fault any more, and was asked to clear it until this scan."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.run(0.1)
    rig.drive.error_code = 7
    rig.run(0.1)
    rig.spoil = lambda drive: drive._replace(state=DriveState.FAULT)
    rig.op(reset=True)
    rig.run(0.01)
    assert rig.output.request is DriveRequest.FAULT_RESET
    rig.spoil = None
    rig.drive.pos_motor_rad += rad(0.0205) * RATIO
    rig.run(0.02)
    assert "BRK-04" in rig.codes
    assert rig.axis.power.phase is P.TORQUE_HOLD
    assert rig.output.request is DriveRequest.ENABLE


@pytest.mark.parametrize("stopping", [False, True])
def test_a_drive_whose_state_is_not_told_any_more_is_asked_for_its_ramp(stopping):
    """CAN-03 after 30 ms is a quick stop, and an unknown state is no reason to make it a fall onto the brake."""
    rig = moving_rig()
    age = 0

    def silent(drive):
        nonlocal age
        age += 1
        return drive._replace(age_scans=age, link=LinkFlag.LATE)

    if stopping:
        rig.op(quick_stop=True)
    rig.spoil = silent
    rig.run(0.2)
    assert rig.codes == (["INT-06", "CAN-03"] if stopping else ["CAN-03"])
    assert rig.axis.power.phase is P.QUICK_STOPPING
    assert rig.output.request is DriveRequest.QUICK_STOP


@PERIODS
@pytest.mark.parametrize(("speed_deg_s", "by_drive"), [(0.0, False), (0.6, False), (2.0, False), (2.0, True)])
def test_of_a_drive_that_is_not_seen_the_brake_closes_for_the_end_of_its_ramp_and_then_torque_goes_off(
    period_s, speed_deg_s, by_drive
):
    """5.5 deg/s2, 60 ms of reaction and 150 ms of the brake; a drive that owns its brake closes it after its ramp."""
    rig = Rig(config=settings(period_s=period_s, brake_by_drive=by_drive))
    rig.power_up()
    if speed_deg_s:
        rig.move(50.0, speed_deg_s)
        rig.run(2.0)
    age = 0

    def silent(drive):
        nonlocal age
        age += 1
        return drive._replace(age_scans=age, speed_age_scans=age, link=LinkFlag.LATE)

    rig.spoil = silent
    rig.until(lambda: "CAN-03" in rig.codes)
    assert rig.output.request is DriveRequest.QUICK_STOP
    begun = rig.scan
    rig.until(lambda: not rig.output.brake_open)
    closes_s = (rig.scan - begun) * period_s
    rig.until(lambda: rig.output.request is DriveRequest.DISABLE)
    off_s = (rig.scan - begun) * period_s
    ends_s = speed_deg_s / 5.5 + 0.060
    assert closes_s == approx(max(0.0, ends_s - (0.0 if by_drive else 0.150)), abs=2.01 * period_s)
    assert off_s == approx(max(0.0, ends_s - (0.0 if by_drive else 0.150)) + 0.150, abs=2.01 * period_s)
    assert rig.axis.power.phase is P.TORQUE_OFF
    assert rig.axis.alarms.active["CAN-03"].reaction is Reaction.TORQUE_OFF


def unseen(rig):
    """From now on every reading is a scan older."""
    age = 0

    def silent(drive):
        nonlocal age
        age += 1
        return drive._replace(age_scans=age, speed_age_scans=age, link=LinkFlag.LATE)

    rig.spoil = silent
    rig.until(lambda: "CAN-03" in rig.codes)


@PERIODS
@pytest.mark.parametrize(
    ("by_drive", "ramp_s", "speed_deg_s", "closes_s", "off_s"),
    [
        # 100 ms behind the last speed, 70 ms behind CAN-03; the brake grips after 150 ms, and then the torque goes.
        (False, 0.0, 6.0, 0.070, 0.220),
        # A drive that owns its brake takes its torque off: 1.08 s of its ramp are left.
        (True, 0.78, 6.0, 0.070, 0.070),
        # Of a ramp from 4 deg/s 0.717 s are left: it is trusted to its end, 0.787 s.
        (True, 0.78, 4.0, 0.787, 0.937),
        # A brake that is weaker than the ramp closes for its end: 1.151 s.
        (False, math.inf, 6.0, 1.001, 1.151),
    ],
)
def test_a_ramp_that_nobody_sees_is_ended_by_the_brake_where_that_takes_no_longer(
    period_s, by_drive, ramp_s, speed_deg_s, closes_s, off_s
):
    rig = Rig(config=settings(period_s=period_s, brake_by_drive=by_drive, unseen_ramp_s=ramp_s))
    rig.power_up()
    rig.move(100.0, speed_deg_s)
    rig.run(3.0)
    unseen(rig)
    begun = rig.scan
    assert rig.output.brake_open
    rig.until(lambda: not rig.output.brake_open)
    # Two scans, and 2 ms more in which 8 scans of 4 ms are later than 30 ms.
    assert (rig.scan - begun) * period_s == approx(closes_s, abs=2.01 * period_s)
    rig.until(lambda: rig.output.request is DriveRequest.DISABLE)
    assert (rig.scan - begun) * period_s == approx(off_s, abs=2.01 * period_s)
    assert rig.axis.alarms.active["CAN-03"].reaction is Reaction.TORQUE_OFF


def asked(rig, speed_deg_s, age=1):
    """No telegram comes any more, and the speed is read by other means: `speed_deg_s` of the s since CAN-03."""
    scans, begun, before = 0, None, []

    def without(drive):
        nonlocal scans, begun
        scans += 1
        if begun is None and "CAN-03" in rig.codes:
            begun = rig.scan - 1
        before[:] = before or [drive.vel_act_rad_s]
        told = {
            "age_scans": scans,
            "inputs_age_scans": scans,
            "speed_age_scans": scans,
            "link": LinkFlag.LATE,
        }
        if begun is None:
            return drive._replace(**told, vel_act_rad_s=before[0])
        if scans > age:
            told["speed_age_scans"] = age
        deg_s = speed_deg_s((rig.scan - begun - age) * rig.period_s)
        return drive._replace(**told, vel_act_rad_s=rad(deg_s) * RATIO)

    rig.spoil = without
    rig.until(lambda: "CAN-03" in rig.codes)
    return rig.scan


def times(rig, begun):
    """When the brake closes and the torque goes off, s since a scan."""
    rig.until(lambda: not rig.output.brake_open)
    closes_s = (rig.scan - begun) * rig.period_s
    rig.until(lambda: rig.output.request is DriveRequest.DISABLE)
    assert rig.axis.power.phase is P.TORQUE_OFF
    return closes_s, (rig.scan - begun) * rig.period_s


@BOTH
@pytest.mark.parametrize("period_s", [0.004, 0.010])
@pytest.mark.parametrize(
    ("by_drive", "from_deg_s", "speed", "closes_s", "off_s", "codes"),
    [
        # It falls as the ramp does: the brake closes for its end, 6 / 5.5 + 0.06 s, and the torque goes as it grips.
        (False, 6.0, lambda t: max(0.0, 6.0 - 5.5 * t), 1.001, 1.151, []),
        (True, 6.0, lambda t: max(0.0, 6.0 - 5.5 * t), 1.151, 1.301, []),
        (True, 2.0, lambda t: max(0.0, 2.0 - 5.5 * t), 0.424, 0.574, []),
        # It does not fall: 0.5 deg/s above the ramp 0.151 s behind its begin, and told 50 ms later.
        (False, 6.0, lambda t: 6.0, 0.201, 0.201, ["DRV-07"]),
        (True, 2.0, lambda t: 2.0, 0.201, 0.201, ["DRV-07"]),
        # It grows with 9 deg/s2, its sign turned: 0.5 deg/s above the ramp after 0.056 s.
        (True, 2.0, lambda t: -2.0 - 9.0 * t, 0.106, 0.106, ["DRV-07"]),
        (False, 2.0, lambda t: 2.0 + 9.0 * t, 0.106, 0.106, ["DRV-07"]),
        # It stands sooner than any ramp: such a reading shows nothing. The last speed was 30 ms old at the begin.
        (False, 2.0, lambda t: 0.0, 0.070, 0.220, []),
        (True, 2.0, lambda t: 0.0, 0.424, 0.574, []),
        (True, 6.0, lambda t: 5.0 - 5.5 * t, 0.070, 0.070, []),
        # It is believed for 0.15 s.
        (False, 2.0, lambda t: (2.0 - 5.5 * t) * (t < 0.15), 0.250, 0.400, []),
    ],
)
def test_a_ramp_whose_speed_is_asked_for_is_judged_by_it(
    period_s, way, by_drive, from_deg_s, speed, closes_s, off_s, codes
):
    ramp_s = 0.78 if by_drive else 0.0
    rig = Rig(config=settings(period_s=period_s, brake_by_drive=by_drive, unseen_ramp_s=ramp_s))
    rig.power_up()
    rig.move(way * 60.0, from_deg_s)
    rig.run(0.5 + 0.5 * from_deg_s)
    begun = asked(rig, lambda t: way * speed(t))
    # Two scans, 2 ms in which 8 scans of 4 ms are later than 30 ms, and the scan of the answer.
    assert times(rig, begun) == (
        approx(closes_s, abs=3.01 * period_s + 0.002),
        approx(off_s, abs=3.01 * period_s + 0.002),
    )
    assert rig.codes == ["CAN-03", *codes]


def test_a_speed_that_was_asked_for_30_ms_ago_is_not_known():
    """8 scans of 4 ms: nothing is seen, as without an answer."""
    rig = Rig(config=settings(period_s=0.004, unseen_ramp_s=0.0))
    rig.power_up()
    rig.move(60.0, 6.0)
    rig.run(3.0)
    begun = asked(rig, lambda t: max(0.0, 6.0 - 5.5 * t), age=8)
    assert times(rig, begun) == (approx(0.070, abs=0.009), approx(0.220, abs=0.009))


@PERIODS
@pytest.mark.parametrize(("missing_s", "told_open"), [(0.088, True), (0.130, False)])
def test_a_brake_that_has_begun_to_end_a_ramp_is_not_opened_as_the_speed_comes_back(
    period_s, missing_s, told_open
):
    """Missing for less than a tenth of a second, the speed leaves the ramp to the drive."""
    rig = Rig(config=settings(period_s=period_s, unseen_ramp_s=0.0))
    rig.power_up()
    rig.move(100.0, 6.0)
    rig.run(3.0)
    begun = rig.scan
    unseen(rig)
    rig.run(missing_s - (rig.scan - begun) * period_s)
    rig.spoil = None
    for _ in range(4):
        rig.step()
        assert rig.axis.power.phase is P.QUICK_STOPPING
        assert rig.output.brake_open is told_open


@PERIODS
def test_the_brake_opens_after_the_proof_and_the_preload_and_power_is_on_after_the_sag_watch(period_s):
    """50 ms to the preload and as long again; 200 ms of sag watch, which begins when the contact shows open."""
    rig = Rig(config=settings(period_s=period_s, holding_torque_nm=12.0))
    rig.op(power=True)
    begun = {}
    while rig.axis.power.phase is not P.ON:
        begun.setdefault(rig.axis.power.phase, rig.scan)
        assert rig.output.brake_open is (rig.axis.power.phase in (P.RELEASING, P.SAG_WATCH))
        assert not rig.program.power.status
        rig.step()
    ramp = math.ceil(0.050 / period_s - 1e-9)
    assert begun[P.RELEASING] - begun[P.SETTLING] == 2 * ramp
    assert rig.scan - begun[P.SAG_WATCH] == math.ceil(0.200 / period_s - 1e-9)
    assert rig.axis.power.status


@PERIODS
@pytest.mark.parametrize("closes_s", [0.010, 0.300])
def test_torque_stays_until_the_brake_has_had_its_time_and_its_contact_shows_closed(period_s, closes_s):
    """150 ms, or when the contact comes, if that is later; until then all of the torque."""
    rig = Rig(config=settings(period_s=period_s, holding_torque_nm=12.0))
    rig.power_up()
    held_nm = rig.output.torque_ff_nm
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.CLOSING)
    start = rig.scan
    rig.spoil = lambda drive: drive._replace(brake_open=(rig.scan - start) * period_s < closes_s)
    while rig.axis.power.phase is P.CLOSING:
        assert rig.output.torque_ff_nm == held_nm
        assert rig.output.request is DriveRequest.ENABLE
        rig.step()
    assert (rig.scan - start) * period_s == approx(max(0.150, closes_s), abs=2.01 * period_s)
    assert rig.axis.power.phase is P.UNLOADING
    assert rig.output.request is DriveRequest.ENABLE
    assert rig.codes == []


@PERIODS
def test_a_brake_whose_contact_never_closes_is_told_after_its_time_and_tried_step_by_step(period_s):
    """150 ms to close and 300 ms for the contact."""
    rig = Rig(config=settings(period_s=period_s))
    rig.power_up()
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.op(power=False)
    start = rig.scan
    rig.until(lambda: bool(rig.codes), 2.0)
    assert rig.codes == ["BRK-06"]
    assert (rig.scan - start) * period_s == approx(
        in_scans(0.150, period_s) + in_scans(0.300, period_s), abs=2.01 * period_s
    )
    assert rig.axis.power.phase is P.UNLOADING
    assert rig.output.request is DriveRequest.ENABLE


@PERIODS
def test_a_brake_that_shows_open_with_power_off_is_told_after_its_time(period_s):
    rig = Rig(config=settings(period_s=period_s))
    rig.run(1.0)
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 2.0)
    start = rig.scan
    rig.spoil = lambda drive: drive._replace(brake_open=True)
    rig.until(lambda: bool(rig.codes), 2.0)
    assert rig.codes == ["BRK-06"]
    assert (rig.scan - start) * period_s == approx(0.450, abs=3.01 * period_s)


@BOTH
def test_the_unloading_lowers_the_torque_and_gives_all_of_it_back_to_a_brake_that_slips(way):
    """-4 N m of 12 each 50 ms, whichever way the load pulls."""
    rig = Rig(config=settings(holding_torque_nm=way * 12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.power.phase is P.UNLOADING)
    for wanted_nm in (8.0, 4.0):
        rig.run(0.048)
        assert rig.output.torque_ff_nm == approx(way * wanted_nm)
        rig.run(0.002)
    slip(rig, way * 0.021)
    rig.step()
    assert rig.axis.power.phase is P.TORQUE_HOLD
    rig.step()
    assert rig.output.torque_ff_nm == approx(way * 12.0)
    assert rig.codes == ["BRK-03"]


def test_a_torque_that_is_not_believed_is_not_unloaded_step_by_step():
    """The brake would be loaded by what the reading is wrong by."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.axis.power.holding.believed = False
    rig.op(power=False)
    seen = []
    while not rig.axis.is_off:
        rig.step()
        seen.append(rig.axis.power.phase)
    assert P.UNLOADING not in seen
    assert seen.count(P.CLOSING) >= 149


@pytest.mark.parametrize(("later_s", "code"), [(1.9, "BRK-03"), (2.1, "BRK-04")])
def test_a_brake_that_slips_within_2_s_after_the_torque_is_one_that_did_not_hold(later_s, code):
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off, 2.0)
    rig.run(later_s)
    slip(rig, 0.021)
    rig.run(0.05)
    assert rig.codes[0] == code


def test_power_taken_back_in_the_scan_in_which_the_contact_shows_open_closes_the_brake_in_that_scan():
    """Only a drive that owns its brake goes on to the end of its own sequence first."""
    rig = Rig()
    rig.spoil = lambda drive: drive._replace(brake_open=opened)
    opened = False
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.RELEASING)
    rig.op(power=False)
    opened = True
    rig.step()
    assert rig.axis.power.phase is P.CLOSING
    assert not rig.output.brake_open


def test_power_taken_back_while_a_drive_opens_its_own_brake_closes_it_at_once_in_the_sag_watch():
    rig = OwnBrake()
    rig.op(power=True)
    rig.until(lambda: rig.axis.power.phase is P.SAG_WATCH)
    rig.run(0.05)
    rig.op(power=False)
    rig.step()
    assert rig.axis.power.phase is P.CLOSING
    rig.run(0.5)
    assert rig.axis.power.phase is P.OFF
    assert rig.codes == []


@pytest.mark.parametrize("state", [DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON])
def test_power_taken_back_before_a_drive_with_its_own_brake_has_begun_is_off_at_once(state):
    """From Switched on it is opening its brake: it goes on to the end, and back from there."""
    rig = OwnBrake()
    own = rig.spoil
    rig.spoil = lambda drive: drive._replace(state=state, brake_open=False)
    rig.op(power=True)
    rig.op(power=False)
    rig.step()
    begun = state is DriveState.SWITCHED_ON
    assert (rig.axis.power.phase is P.ENABLING) is begun
    assert rig.axis.power.falling
    assert (rig.output.request is DriveRequest.ENABLE) is begun
    seen = set()
    rig.spoil = own
    for _ in range(1000):
        rig.step()
        seen.add(rig.axis.power.phase)
    assert rig.axis.power.phase is P.OFF
    assert P.ON not in seen
    # What it has opened it closes before its torque goes off.
    assert (P.SAG_WATCH in seen) is (P.CLOSING in seen) is begun
    assert rig.codes == []


def test_power_taken_back_before_the_controller_opens_its_brake_goes_off_at_once():
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCHED_ON)
    rig.op(power=True)
    rig.op(power=False)
    rig.step()
    assert rig.axis.power.phase is P.DISABLING
    for _ in range(1000):
        rig.step()
        assert not rig.output.brake_open
        assert rig.output.torque_ff_nm == 0.0
    assert rig.axis.power.phase is P.OFF


def test_a_test_of_the_brake_that_is_taken_back_while_the_drive_is_enabled_never_gives_torque():
    rig = Rig(config=settings(test_torque_nm=65.0))
    rig.run(0.05)
    rig.op(brake_test=True)
    assert rig.axis.power.phase is P.ENABLING
    rig.op(brake_test=False, stop=True)
    for _ in range(100):
        rig.step()
        assert rig.output.torque_ff_nm == 0.0
        assert not rig.output.brake_open
    assert rig.axis.power.phase is P.OFF
    assert rig.axis.brake_test.last.outcome.name == "ABORTED"
    assert rig.axis.brake_test.count == 1


def test_power_takes_no_order_that_does_not_belong_to_its_phase():
    rig = powered()
    power = rig.axis.power
    for order in (power.switch_on, power.wake, power.begin_test, power.release_hold):
        order()
        assert power.phase is P.ON
    power.abort_test(Words.STOPPED)
    assert power.brake_test.count == 0
    rig.op(power=False)
    rig.until(lambda: power.phase is P.UNLOADING)
    for order in (power.switch_off, power.park, power.switch_on):
        order()
        assert power.phase is P.UNLOADING
    slip(rig, 0.021)
    rig.step()
    power.switch_off()
    assert power.phase is P.TORQUE_HOLD


def test_a_drive_that_does_not_give_the_torque_back_is_told_and_the_brake_is_all_there_is():
    """2 s to be enabled."""
    rig = Rig(config=settings(holding_torque_nm=12.0))
    rig.power_up()
    rig.op(power=False)
    rig.until(lambda: rig.axis.is_off)
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    slip(rig, 0.021)
    rig.run(0.01)
    assert rig.axis.power.phase is P.TORQUE_HOLD
    start = rig.scan
    rig.until(lambda: rig.axis.power.phase is not P.TORQUE_HOLD, 3.0)
    assert (rig.scan - start) * rig.period_s == approx(2.0, abs=0.02)
    assert "DRV-03" in rig.codes
    assert rig.output.request is DriveRequest.DISABLE
    assert rig.output.torque_ff_nm == 0.0


def test_a_drive_that_leaves_hold_is_not_asked_again():
    rig = held_again()
    rig.spoil = lambda drive: drive._replace(state=DriveState.SWITCH_ON_DISABLED)
    rig.run(0.01)
    assert "DRV-04" in rig.codes
    assert rig.axis.power.phase in (P.TORQUE_OFF, P.OFF)
    assert rig.output.request is DriveRequest.DISABLE


@pytest.mark.parametrize(("rig", "proof"), [(Rig, Proof.PROVEN), (OwnBrake, Proof.NOT_POSSIBLE)])
def test_a_proof_is_of_this_power_up_and_of_a_brake_that_the_controller_opens(rig, proof):
    rig = rig()
    for _ in range(2):
        rig.op(power=True)
        while rig.axis.power.phase is not P.ON:
            rig.step()
            if rig.axis.power.phase is P.PROVING:
                assert rig.axis.power.proof is Proof.NOT_DONE
        assert rig.axis.power.proof is proof
        rig.op(power=False)
        rig.until(lambda: rig.axis.is_off, 2.0)


def test_a_brake_that_slips_while_a_fault_is_reset_gets_torque():
    """The drive has cleared its fault in the scan in which the load moves: it is asked for torque, not for a reset."""
    rig = Rig()
    rig.run(0.1)
    rig.axis.power.fault_reset = True
    rig.step()
    assert rig.output.request is DriveRequest.FAULT_RESET
    rig.axis.alarms.raise_(Code.BRK_04, measured=0.03, limit=0.02)
    rig.step()
    assert (rig.axis.power.phase, rig.output.request) == (P.TORQUE_HOLD, DriveRequest.ENABLE)
