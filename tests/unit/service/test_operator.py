"""Commands judged in the scan: roles, control, age, hold-to-run, stops. Virtual gantry, virtual time.

INV-10: every command that changes something has an identity, a role and control; a stop needs none of them.
"""

from __future__ import annotations

import json
import random

import pytest

from gantryctl.image import Mode
from gantryctl.machine import configs_folder, load_machine
from gantryctl.program import AxisState, PowerPhase
from gantryctl.service.memory.memory import JournalState, Word
from gantryctl.service.protocol.messages import FIELDS, WITHOUT_EPOCH, action_of, checked
from gantryctl.service.protocol.roles import RIGHTS, Action, Role, may
from gantryctl.units import deg, rad
from support.service_bench import LEASE, MACHINE, RAMP_S, SPEED_DEG_S, Bench

VALUES: dict[str, dict[str, object]] = {
    "take": {"over": False}, "power": {"on": True}, "mode": {"mode": "none"}, "renew": {"lease": LEASE},
    "jog": {"lease": LEASE, "direction": "forward"}, "release": {"lease": LEASE},
    "increment": {"direction": "forward"}, "move": {"target_deg": 1.0}, "move_by": {"distance_deg": 1.0},
    "acknowledge": {"id": 1}, "commission_step": {"step": "identity"}, "note": {"line": "the door is repaired"},
    "arm": {"action": "brake_test"}, "set": {"tag": "speed_setting_deg_s", "value": 1.0},
}  # fmt: skip
LEASE_S = 0.250


@pytest.mark.parametrize("kind", sorted(set(FIELDS) - {"alive", "renew"}))
@pytest.mark.parametrize("role", Role)
def test_the_scan_itself_refuses_what_the_role_may_not(role: Role, kind: str) -> None:
    bench = Bench()
    values = VALUES.get(kind, {})
    stamp = {} if kind in WITHOUT_EPOCH else {"epoch": 1}
    message = checked({"type": kind, "seq": 1, "frame": "1-0000000000000000", **stamp, **values})
    action = action_of(message)
    reply = bench.ask(bench.who(role), kind, **values)
    if not may(role, action):
        assert reply["code"] == "SEC-01"
    elif (RIGHTS[action].control and kind != "arm") or kind == "give":
        assert reply["code"] == "SEC-07"
    else:
        assert reply["code"] in ("", "SEC-05")  # there is no alarm to acknowledge


@pytest.mark.parametrize(
    "tag", ["speed_setting_deg_s", "increment_deg", "override_percent", "acc_setting_deg_s2"]
)
@pytest.mark.parametrize("role", Role)
def test_settings_need_their_role_and_stay_within_their_limits(role: Role, tag: str) -> None:
    bench = Bench()
    who = bench.who(role)
    tunes = Action.ACCELERATION if tag == "acc_setting_deg_s2" else Action.SPEED
    if not may(role, Action.AUTHORITY):
        assert bench.refused(who, "set", tag=tag, value=1.0) == "SEC-01"
        return
    bench.do(who, "take", over=False)
    *_, low, high = bench.operator.ranges[tag]
    if not may(role, tunes):
        assert bench.refused(who, "set", tag=tag, value=high) == "SEC-01"
        return
    for value in (low, high):
        bench.do(who, "set", tag=tag, value=value)
    for value in (low - 0.01 * high, high * 1.001):
        assert bench.refused(who, "set", tag=tag, value=value) == "CTL-01"


@pytest.mark.parametrize(
    ("tag", "value"),
    [
        ("speed_setting_deg_s", 2.5),
        ("increment_deg", 3.0),
        ("override_percent", 40.0),
        ("acc_setting_deg_s2", 0.3),
    ],
)
def test_the_journal_has_a_setting_before_and_after(tag: str, value: float) -> None:
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.do(who, "take", over=False)
    before = round(bench.operator.setting(tag), 6)
    bench.do(who, "set", tag=tag, value=value)
    bench.do(who, "set", tag=tag, value=value)
    events = [
        json.loads(record) for record in bench.event_ring.peek(100) if record and b'"setting"' in record
    ]
    found = [
        (each["values"]["before"], each["values"]["value"]) for each in events if "tag" in each["values"]
    ]
    assert found == [(before, value), (value, value)]
    assert events[-1]["text"] == f"set {tag} {value} (before: {value:g}): done"


@pytest.mark.parametrize("target_deg", [1e9, -1e9])
def test_a_target_beyond_all_machines_is_refused_with_the_travel_of_this_one(target_deg: float) -> None:
    bench = Bench()
    who = bench.who(Role.OPERATOR)
    bench.powered(who)
    reply = bench.ask(who, "move", target_deg=target_deg)
    assert reply["text"] == f"target must be within -180.00 and 180.00 deg, got {target_deg:.0f} deg"


def test_a_lower_acceleration_makes_the_same_move_longer() -> None:
    times = []
    for share in (1.0, 0.25):
        bench = Bench()
        who = bench.who(Role.PHYSICIST)
        bench.powered(who)
        bench.do(who, "set", tag="acc_setting_deg_s2", value=share * MACHINE.virtual_axis.acc_deg_s2)
        begin = bench.engine.time_s
        bench.do(who, "move", target_deg=0.5)
        bench.until(AxisState.STANDSTILL)
        times.append(bench.engine.time_s - begin)
    assert times[1] / times[0] == pytest.approx(2.0, rel=0.1)  # a short move takes as 1 / sqrt(acceleration)


def jogging(bench: Bench) -> None:
    who = bench.who()
    bench.powered(who)
    bench.do(who, "set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
    bench.do(who, "jog", lease=LEASE, direction="forward")


def test_a_key_held_moves_and_a_lost_holder_stops_within_lease_and_ramp() -> None:
    bench = Bench()
    jogging(bench)
    bench.hold(12.0)
    assert deg(bench.axis.virtual.vel_ref_rad_s) == pytest.approx(SPEED_DEG_S, abs=1e-6)
    assert bench.rest_after_s() <= LEASE_S + RAMP_S + 0.005


def test_release_stops_at_once_and_the_lease_is_dead() -> None:
    bench = Bench()
    jogging(bench)
    bench.hold(12.0)
    bench.send(bench.who(), "release", lease=LEASE)
    assert bench.rest_after_s() <= RAMP_S + 0.005
    assert bench.refused(bench.who(), "renew", lease=LEASE) == "SEC-09"
    assert bench.refused(bench.who(), "jog", lease=LEASE, direction="forward") == "SEC-09"
    bench.scans(500)
    assert bench.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize(("frozen_ms", "stops"), [(60, 0), (120, 0), (200, 0), (400, 1), (800, 1), (1200, 1)])
def test_a_frozen_network_stops_once_or_not_at_all_and_never_starts_again(frozen_ms: int, stops: int) -> None:
    """Both ways freeze: the page goes on renewing with the last frame it saw, and everything arrives at the thaw."""
    bench = Bench()
    who = bench.who()
    jogging(bench)
    bench.hold(3.0)
    kept, seen, before = [], bench.frame(who), bench.stops
    for _ in range(frozen_ms // 30):
        bench.scans(30)
        bench.seq += 1
        kept.append({"type": "renew", "seq": bench.seq, "frame": seen, "epoch": bench.epoch, "lease": LEASE})
    bench.scans(frozen_ms % 30)
    for raw in kept:
        bench.send(who, **{**raw, "kind": raw["type"]})
    for _ in range(150):  # thawed: the page still holds the key
        bench.send(who, "renew", lease=LEASE)
        bench.scans(20)
    assert bench.stops - before == stops
    assert (bench.axis.state is AxisState.STANDSTILL) is bool(stops)


def test_press_and_release_in_a_freeze_start_nothing() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    old = bench.frame(who)
    bench.scans(600)
    bench.send(who, "jog", lease=LEASE, direction="forward", frame=old)
    bench.send(who, "release", lease=LEASE)
    for _ in range(500):
        bench.scans(1)
        assert bench.axis.state is AxisState.STANDSTILL
    assert (
        bench.refused(who, "jog", lease=LEASE, direction="forward") == "SEC-09"
    )  # the release has killed it


def test_a_release_that_overtakes_its_press_starts_nothing() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.send(who, "release", lease=LEASE)
    bench.send(who, "jog", lease=LEASE, direction="forward")
    bench.scans(500)
    assert bench.axis.state is AxisState.STANDSTILL


def test_stop_is_for_everyone_and_kills_what_was_sent_before() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(3000)
    epoch = bench.epoch
    bench.send(who, "move", target_deg=-20.0)
    bench.send(bench.who(Role.VIEWER), "stop")
    bench.until(AxisState.STANDSTILL)
    here = bench.axis.pos_act_rad
    bench.scans(2000)
    assert bench.axis.pos_act_rad == pytest.approx(here, abs=rad(0.01))  # settling of the gear
    assert bench.refused(who, "move", target_deg=1.0, epoch=epoch) == "SEC-03"
    bench.do(who, "move", target_deg=1.0)


def test_quick_stop_leads_to_error_stop_and_power_needs_reset_and_a_new_command() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(3000)
    bench.do(bench.who(Role.ADMIN), "quick_stop")
    bench.until(AxisState.ERROR_STOP)
    bench.scans(5000)
    assert bench.refused(who, "power", on=True) == "PWR-04"
    bench.do(who, "reset")
    bench.scans(2000)
    assert bench.axis.state is AxisState.DISABLED
    bench.do(who, "power", on=True)
    bench.until(AxisState.STANDSTILL)
    bench.scans(1000)
    assert bench.axis.state is AxisState.STANDSTILL  # the old move is gone


def test_the_local_console_takes_control_and_stops_what_moves() -> None:
    bench = Bench()
    who, console = bench.who(), bench.who(Role.SERVICE, place="local")
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(3000)
    bench.do(console, "take", over=False)
    bench.until(AxisState.STANDSTILL)
    assert bench.refused(who, "move", target_deg=1.0) == "SEC-07"
    assert bench.refused(who, "take", over=True) == "SEC-08"


def test_control_is_taken_over_from_who_stands_and_not_from_who_moves() -> None:
    bench = Bench()
    who, other = bench.who(), bench.who(client="other")
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(3000)
    assert bench.refused(other, "take", over=True) == "SEC-08"
    assert bench.operator.authority.holds(who)
    bench.do(who, "halt")
    bench.until(AxisState.STANDSTILL)
    bench.do(other, "take", over=True)
    assert bench.operator.authority.holds(other)


def test_commands_of_one_scan_are_done_one_after_the_other_and_each_has_its_answer() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    sent = [bench.send(who, "move_by", distance_deg=5.0), bench.send(who, "halt")]
    # A scan for each, and one between them in which the levels fall.
    bench.scans(4)
    answered = {}
    for ring in bench.replies:
        while (record := ring.take()) is not None:
            reply = json.loads(record)[1]
            answered[reply["seq"]] = reply["ok"]
    assert answered == dict.fromkeys(sent, True)


def test_a_holder_that_is_silent_loses_control_and_its_move_goes_on() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.lively = False
    bench.do(who, "move", target_deg=3.0)
    bench.until(AxisState.STANDSTILL)
    assert deg(bench.axis.pos_act_rad) == pytest.approx(3.0, abs=0.01)
    assert bench.operator.authority.holder is None


def test_an_increment_is_one_edge_and_a_jog_key_never_makes_one() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who, Mode.INCREMENTAL)
    bench.do(who, "set", tag="increment_deg", value=0.5)
    assert bench.refused(who, "jog", lease=LEASE, direction="forward") == "CTL-16"
    bench.do(who, "increment", direction="reverse")
    bench.until(AxisState.STANDSTILL)
    bench.scans(1000)
    assert deg(bench.axis.virtual.pos_ref_rad) == pytest.approx(-0.5, abs=1e-6)


def test_a_journal_that_cannot_keep_events_forbids_new_motion_but_no_stop() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.words[Word.JOURNAL_STATE] = JournalState.FAILED
    bench.scans(2000)
    assert bench.axis.state is AxisState.DISCRETE_MOTION  # what moves goes on
    bench.do(who, "stop")
    bench.until(AxisState.STANDSTILL)
    assert bench.refused(who, "move", target_deg=1.0) == "JRN-02"
    assert bench.refused(who, "jog", lease=LEASE, direction="forward") == "JRN-02"
    bench.do(who, "power", on=False)


def test_events_that_pile_up_in_memory_forbid_new_motion_before_the_first_one_is_lost() -> None:
    """As when a commit takes minutes: the journal's writer stands, nothing else does."""
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    while bench.events.room:
        bench.events.put("service", "piling up")
    bench.scans(2000)
    assert bench.axis.state is AxisState.DISCRETE_MOTION  # what moves goes on
    assert bench.refused(who, "move", target_deg=1.0) == "JRN-02"
    bench.do(who, "stop")
    bench.until(AxisState.STANDSTILL)
    assert bench.events.lost == 0
    assert bench.event_ring.clear() > 0  # the writer goes on
    bench.do(who, "move", target_deg=1.0)


def test_remote_screens_are_slow_without_the_enabling_switch() -> None:
    bench = Bench()
    who = bench.who(place="remote")
    bench.powered(who)
    bench.engine.drive.faults.enabling_switch = False
    bench.do(who, "set", tag="speed_setting_deg_s", value=1.5)
    assert bench.refused(who, "move", target_deg=1.0) == "INT-05"
    assert bench.refused(who, "jog", lease=LEASE, direction="forward") == "INT-05"
    bench.do(who, "set", tag="speed_setting_deg_s", value=1.0)
    bench.do(who, "move", target_deg=1.0)


def test_a_shutdown_brings_the_axis_to_rest_and_takes_power_off() -> None:
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "move", target_deg=20.0)
    bench.scans(3000)
    bench.operator.shutdown = True
    bench.until(AxisState.DISABLED, 15.0)
    bench.scans(1000)
    assert bench.axis.power.phase is PowerPhase.OFF
    assert bench.axis.at_rest
    assert not bench.engine.drive.read().brake_open


# 0.7 s of a processor each.
@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(4, 10))]
)
def test_random_gestures_never_leave_the_axis_moving_without_a_hand_on_the_key(seed: int) -> None:
    """Ten gestures each: press, hold, lose messages, release, stop, vanish. Then silence: at rest in time."""
    random_ = random.Random(seed)
    bench = Bench()
    who = bench.who()
    bench.powered(who)
    bench.do(who, "set", tag="speed_setting_deg_s", value=SPEED_DEG_S)
    for number in range(10):
        lease = f"{seed:08x}{number:08x}"
        if bench.operator.authority.holder is None:
            bench.do(who, "take", over=False)
        bench.send(who, "jog", lease=lease, direction=random_.choice(["forward", "reverse"]))
        for _ in range(random_.randrange(20)):
            bench.scans(random_.choice([10, 30, 30, 60, 240, 260]))
            if random_.random() < 0.8:
                bench.send(who, "renew", lease=lease)
        ending = random_.choice(["release", "stop", "nothing", "gone"])
        if ending == "release":
            bench.send(who, "release", lease=lease)
        elif ending == "stop":
            bench.send(who, "stop")
        elif ending == "gone":
            bench.commands[0].put(
                b'["%s","operator","operator","console","",{"type":"gone"}]' % who.client.encode()
            )
        bench.scans(round((LEASE_S + RAMP_S) * 1000) + 5)
        assert bench.axis.at_rest, (number, ending)


@pytest.mark.parametrize("on_bus", [False, True])
def test_the_axis_is_handed_over_for_commissioning_with_power_off_and_a_drive_on_a_bus(on_bus: bool) -> None:
    bench = Bench(machine=load_machine(configs_folder() / "hust_can.toml")) if on_bus else Bench()
    who = bench.who(Role.SERVICE)
    assert bench.refused(who, "commission_begin") == "SEC-07"
    bench.do(who, "take", over=False)
    assert bench.refused(who, "commission_step", step="identity") == "CTL-14"
    if not on_bus:
        assert bench.refused(who, "commission_begin") == "CTL-14"
        assert not bench.operator.shutdown
        return
    bench.do(who, "commission_begin")
    assert (bench.operator.shutdown, bench.operator.hands_over) == (True, True)
    assert not bench.operator.levels.power
