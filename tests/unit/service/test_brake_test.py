"""Brake test and reset of what is locked, as people ask for them: arm, then execute. Virtual gantry and time."""

from __future__ import annotations

import pytest

from gantryctl.image import DriveRequest
from gantryctl.program import AxisState, BrakeTestOutcome, BrakeTestPhase, Code, PowerPhase
from gantryctl.program.alarms.words import Words
from gantryctl.service.command.rules import check_allowed
from gantryctl.service.memory.memory import JournalState, Word
from gantryctl.service.protocol.limits import ARMED_S
from gantryctl.service.protocol.messages import MessageRefused, checked
from gantryctl.service.protocol.roles import Action, Role, may
from support.service_bench import Bench

TEST_S = 10.0
RUNNING = [
    BrakeTestPhase.ENABLING, BrakeTestPhase.PLUS_RISING, BrakeTestPhase.PLUS_HELD, BrakeTestPhase.MINUS_RISING,
    BrakeTestPhase.MINUS_HELD,
]  # fmt: skip


def in_control(bench: Bench, role: Role = Role.PHYSICIST) -> None:
    bench.do(bench.who(role), "take", over=False)


def begun(bench: Bench, role: Role = Role.PHYSICIST) -> None:
    in_control(bench, role)
    bench.do(bench.who(role), "arm", action="brake_test")
    bench.do(bench.who(role), "brake_test")
    assert bench.axis.brake_test.under_way


def reach(bench: Bench, phase: BrakeTestPhase) -> None:
    for _ in range(round(TEST_S / bench.engine.period_s)):
        if bench.axis.brake_test.phase is phase:
            return
        bench.scans(1)
    raise AssertionError(phase)


def outcome(bench: Bench) -> BrakeTestOutcome:
    """Of the test that has ended by now, with everything off."""
    bench.scans(3000)
    power = bench.axis.power
    assert not power.brake_test.under_way
    assert power.phase is PowerPhase.OFF
    assert bench.engine.output.request is DriveRequest.DISABLE
    assert bench.engine.output.torque_ff_nm == 0.0
    assert power.brake_test.last is not None
    return power.brake_test.last.outcome


@pytest.mark.parametrize("place", ["console", "local"])
def test_armed_and_executed_by_the_same_person_it_runs_and_passes(place: str) -> None:
    bench = Bench()
    who = bench.who(Role.SERVICE, place=place)
    bench.do(who, "take", over=False)
    bench.do(who, "arm", action="brake_test")
    bench.do(who, "brake_test")
    bench.scans(7000)
    assert outcome(bench) is BrakeTestOutcome.PASSED
    assert bench.axis.state is AxisState.DISABLED


@pytest.mark.parametrize("role", Role)
@pytest.mark.parametrize("action", [Action.BRAKE_TEST, Action.RESET_LOCKED])
@pytest.mark.parametrize("control", [False, True])
def test_every_cell_of_arming(role: Role, action: Action, control: bool) -> None:
    """Arming needs the role of the action and no control."""
    bench = Bench()
    who = bench.who(role)
    if control and may(role, Action.AUTHORITY):
        bench.do(who, "take", over=False)
    reply = bench.ask(who, "arm", action=str(action))
    assert reply["code"] == ("" if may(role, action) else "SEC-01")


@pytest.mark.parametrize(
    "why", ["never", "other action", "late", "stop", "give", "reset", "other client", "used"]
)
@pytest.mark.parametrize("place", ["console", "local"])
def test_without_a_living_arming_it_is_refused(why: str, place: str) -> None:
    bench = Bench()
    who = bench.who(Role.SERVICE, place=place)
    bench.do(who, "take", over=False)
    if why != "never":
        armer = bench.who(Role.SERVICE, "elsewhere", place) if why == "other client" else who
        bench.do(armer, "arm", action="reset_locked" if why == "other action" else "brake_test")
    if why == "late":
        bench.scans(round(ARMED_S / bench.engine.period_s))
    elif why == "stop":
        bench.do(bench.who(Role.VIEWER), "stop")
    elif why == "give":
        bench.do(who, "give")
        bench.do(who, "take", over=False)
    elif why == "reset":
        bench.do(who, "reset")
    elif why == "used":
        bench.do(who, "brake_test")
        bench.scans(7000)  # it has ended by itself, within the time of the arming and in its epoch
    assert bench.refused(who, "brake_test") == "SEC-10"
    assert not bench.axis.brake_test.under_way


@pytest.mark.parametrize(
    ("user", "person", "arms", "executes"),
    [
        ("bela", "bela", True, True),
        ("anna", "anna", True, False),
        ("bela", "anna", True, False),  # another account of the same person
        ("anna", "bela", True, True),  # whoever it is, the person counts
        ("root", "", False, False),  # of the system, and nobody knows whose
    ],
)
def test_with_a_second_person_another_person_executes(
    user: str, person: str, arms: bool, executes: bool
) -> None:
    bench = Bench(second_person=True)
    anna = bench.who(Role.PHYSICIST, "a")._replace(user="anna", person="anna")
    other = bench.who(Role.SERVICE, "b")._replace(user=user, person=person)
    bench.do(other, "take", over=False)
    bench.do(anna, "arm", action="brake_test")
    assert bench.ask(other, "brake_test")["code"] == ("" if executes else "SEC-10")
    bench.do(anna, "stop")
    reply = bench.ask(other, "arm", action="brake_test")
    assert reply["code"] == ("" if arms else "SEC-10")
    if not arms:
        assert "nobody knows whose account root is" in reply["text"]


def test_it_needs_control_power_off_and_a_brake_that_can_be_tested() -> None:
    bench = Bench()
    who = bench.who(Role.PHYSICIST)
    bench.do(who, "arm", action="brake_test")
    assert bench.refused(who, "brake_test") == "SEC-07"
    bench.powered(who)
    bench.do(who, "arm", action="brake_test")
    assert bench.refused(who, "brake_test") == "CTL-14"
    bench.do(who, "power", on=False)
    bench.until(AxisState.DISABLED)
    bench.scans(2000)
    now = bench.operator.situation(bench.time_s, who, bench.time_s)._replace(untestable=Words.NO_TORQUE_INPUT)
    asked = checked({"type": "brake_test", "seq": 1, "frame": bench.frame(who), "epoch": now.epoch})
    with pytest.raises(MessageRefused, match="not testable here: the drive takes no torque") as refused:
        check_allowed(asked, who, now)
    assert refused.value.refusal.code == "CTL-14"
    bench.words[Word.JOURNAL_STATE] = JournalState.FULL
    assert bench.refused(who, "brake_test") == "JRN-02"


@pytest.mark.parametrize("phase", RUNNING)
@pytest.mark.parametrize("kind", ["stop", "quick_stop"])
@pytest.mark.parametrize("role", [Role.VIEWER, Role.ADMIN])
def test_anybody_stops_it_in_every_phase(phase: BrakeTestPhase, kind: str, role: Role) -> None:
    bench = Bench()
    begun(bench)
    reach(bench, phase)
    bench.do(bench.who(role), kind)
    assert outcome(bench) is BrakeTestOutcome.ABORTED
    assert bench.axis.state is (AxisState.ERROR_STOP if kind == "quick_stop" else AxisState.DISABLED)
    # The level of a stop ends with the motion: afterwards it would hold the axis.
    bench.scans(10)
    assert not bench.operator.levels.stop
    assert not bench.operator.levels.quick_stop


@pytest.mark.parametrize("phase", RUNNING)
@pytest.mark.parametrize("how", ["gone", "gateway", "silent", "give", "console", "power off", "shutdown"])
def test_it_ends_when_whoever_began_it_loses_control(phase: BrakeTestPhase, how: str) -> None:
    bench = Bench()
    begun(bench)
    who = bench.who(Role.PHYSICIST)
    reach(bench, phase)
    if how in ("gone", "gateway"):
        kind = "gone" if how == "gone" else "restart"
        client = who.client if how == "gone" else ""
        bench.commands[0].put(f'["{client}","p","physicist","console","",{{"type":"{kind}"}}]'.encode())
    elif how == "silent":
        bench.lively = False
        bench.scans(2100)  # 2 s of silence end it, unless the test is over before
    elif how == "give":
        bench.do(who, "give")
    elif how == "console":
        bench.do(bench.who(Role.SERVICE, place="local"), "take", over=False)
    elif how == "power off":
        bench.do(bench.who(Role.OPERATOR, "other"), "power", on=False)
    else:
        bench.operator.shutdown = True
        bench.scans(1500)  # at once: back to the preload, and three steps
        assert not bench.axis.brake_test.under_way
    assert outcome(bench) is BrakeTestOutcome.ABORTED
    assert bench.axis.state is AxisState.DISABLED


def test_nothing_is_switched_on_while_it_runs() -> None:
    bench = Bench()
    begun(bench)
    reach(bench, BrakeTestPhase.PLUS_HELD)
    who = bench.who(Role.PHYSICIST)
    assert bench.refused(who, "power", on=True) == "PWR-04"
    assert bench.refused(who, "move", target_deg=5.0) == "PWR-03"
    assert bench.axis.brake_test.under_way


def test_a_locked_alarm_is_reset_by_service_in_two_steps_only() -> None:
    bench = Bench()
    bench.scans(10)
    service, operator = bench.who(Role.SERVICE), bench.who(Role.OPERATOR)
    bench.axis.alarms.raise_(Code.BRK_08, measured="weak")
    bench.do(operator, "take", over=False)
    assert bench.refused(operator, "reset") == "CTL-14"
    assert bench.refused(operator, "arm", action="reset_locked") == "SEC-01"
    bench.do(operator, "give")
    bench.do(service, "take", over=False)
    assert bench.refused(service, "reset") == "SEC-10"
    bench.do(service, "arm", action="brake_test")
    assert bench.refused(service, "reset") == "SEC-10"
    bench.do(service, "arm", action="reset_locked")
    bench.do(service, "reset")
    assert not bench.axis.alarms.active
    bench.do(service, "reset")  # nothing is locked any more: one step


def test_a_failed_brake_refuses_power_until_a_test_passes() -> None:
    bench = Bench()
    bench.scans(10)
    bench.axis.alarms.raise_(Code.BRK_08, measured="weak")
    begun(bench)
    bench.scans(7000)
    assert outcome(bench) is BrakeTestOutcome.PASSED
    bench.do(bench.who(Role.PHYSICIST), "power", on=True)


def test_without_a_passed_test_the_failed_brake_stays_failed() -> None:
    bench = Bench()
    bench.scans(10)
    bench.axis.alarms.raise_(Code.BRK_08, measured="weak")
    begun(bench)
    bench.do(bench.who(Role.VIEWER), "stop")
    assert outcome(bench) is BrakeTestOutcome.ABORTED
    assert Code.BRK_08 in bench.axis.alarms.active


@pytest.mark.parametrize("how", ["stop", "give", "shutdown"])
def test_a_test_that_ends_begins_one_epoch_and_no_more(how: str) -> None:
    """What others send while the torque is taken back is not of the past."""
    bench = Bench()
    begun(bench)
    reach(bench, BrakeTestPhase.PLUS_HELD)
    epoch = bench.epoch
    if how == "shutdown":
        bench.operator.shutdown = True
    else:
        bench.do(bench.who(Role.PHYSICIST), how)
    bench.scans(3)
    after = bench.epoch
    # giving control is a change of control, and the test that it ends a stop
    assert after - epoch == (2 if how == "give" else 1)
    assert outcome(bench) is BrakeTestOutcome.ABORTED
    assert bench.epoch == after
