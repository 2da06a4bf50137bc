"""Arm, then execute: one action, one person (or two), ten seconds, one epoch, once."""

from __future__ import annotations

import pytest

from gantryctl.program.alarms.words import Said
from gantryctl.service.command.arming import Arming, check_armed
from gantryctl.service.protocol.limits import ARMED_S
from gantryctl.service.protocol.messages import Identity, MessageRefused
from gantryctl.service.protocol.roles import Action, Role

ANNA, BELA = (Identity(name, name, Role.SERVICE, "console", name) for name in ("anna", "bela"))
ANNA_ELSEWHERE = ANNA._replace(client="other")
# Another account of Anna's, and one of the system that is nobody's in particular.
ANNAS, NOBODYS = BELA._replace(person="anna"), BELA._replace(user="root", person="")
TEST, LOCKED = Action.BRAKE_TEST, Action.RESET_LOCKED


def armed(*, second_person: bool = False) -> Arming:
    arming = Arming(second_person=second_person)
    arming.arm(TEST, ANNA, 7, 100.0)
    return arming


def allowed(arming: Arming, action: Action, who: Identity, epoch: int = 7, now_s: float = 101.0) -> bool:
    try:
        check_armed(arming.now(epoch, now_s), action, who, second_person=arming.second_person)
    except MessageRefused as refused:
        return refused.refusal.code != "SEC-10"
    return True


@pytest.mark.parametrize("second_person", [False, True])
@pytest.mark.parametrize("who", [ANNA, ANNA_ELSEWHERE, BELA, ANNAS, NOBODYS])
@pytest.mark.parametrize("action", [TEST, LOCKED])
def test_every_cell_of_who_may_execute_what_anna_has_armed(
    action: Action, who: Identity, second_person: bool
) -> None:
    wanted = action is TEST and (who is BELA if second_person else who is ANNA)
    assert allowed(armed(second_person=second_person), action, who) is wanted


@pytest.mark.parametrize(
    ("armed", "step", "wanted"), [("turn", "turn", True), ("sign", "turn", False), ("", "turn", False)]
)
def test_a_step_of_commissioning_is_executed_as_it_was_armed(armed: str, step: str, wanted: bool) -> None:
    arming = Arming(second_person=True)
    arming.arm(Action.COMMISSION, ANNA, 7, 100.0, armed)
    now = arming.now(7, 101.0)
    if wanted:
        check_armed(now, Action.COMMISSION, BELA, step, second_person=True)
    else:
        with pytest.raises(
            MessageRefused, match=f"the step {step} is not armed: anna has armed the step {armed}"
        ):
            check_armed(now, Action.COMMISSION, BELA, step, second_person=True)


def test_it_is_executed_once() -> None:
    arming = armed()
    arming.use()
    assert not allowed(arming, TEST, ANNA)


def test_it_lasts_ten_seconds_and_not_a_moment_longer() -> None:
    assert allowed(armed(), TEST, ANNA, now_s=100.0 + ARMED_S - 0.001)
    assert not allowed(armed(), TEST, ANNA, now_s=100.0 + ARMED_S)
    assert armed().left_s(7, 104.0) == pytest.approx(6.0)
    assert armed().left_s(7, 111.0) == 0.0


def test_it_dies_with_its_epoch_and_stays_dead() -> None:
    arming = armed()
    assert not allowed(arming, TEST, ANNA, epoch=8)
    assert not allowed(arming, TEST, ANNA, epoch=7)


def test_it_dies_with_the_connection_that_armed_it_and_with_no_other() -> None:
    arming = armed()
    arming.gone(BELA.client)
    assert allowed(arming, TEST, ANNA)
    arming.gone(ANNA.client)
    assert not allowed(arming, TEST, ANNA)


@pytest.mark.parametrize("local", [False, True])
def test_it_dies_with_the_gateway_when_it_came_from_there(local: bool) -> None:
    arming = armed()
    arming.gone_all(local=local)
    assert allowed(arming, TEST, ANNA) is local


def test_arming_something_else_takes_its_place() -> None:
    arming = armed()
    arming.arm(LOCKED, ANNA, 7, 101.0)
    assert not allowed(arming, TEST, ANNA, now_s=102.0)
    assert allowed(arming, LOCKED, ANNA, now_s=102.0)


def test_nobody_has_armed_anything_at_the_start() -> None:
    assert not allowed(Arming(), TEST, ANNA)
    assert Arming().left_s(7, 0.0) == 0.0


def test_ends_of_connections_mean_nothing_while_nothing_is_armed() -> None:
    """They come in every scan, and the scan must go on."""
    arming = Arming()
    arming.gone("page")
    for local in (True, False):
        arming.gone_all(local=local)
    arming.use()
    assert arming.now(7, 100.0) is None
    assert arming.left_s(7, 100.0) == 0.0


@pytest.mark.parametrize(
    ("arming", "who", "words"),
    [
        (Arming(), ANNA, "ARM_FIRST"),
        (Arming(second_person=True), BELA, "OTHER_ARMS_FIRST"),
        (armed(), BELA, "ARMED_ELSEWHERE"),
        (armed(second_person=True), ANNA, "OTHER_EXECUTES"),
        (armed(second_person=True), NOBODYS, "PERSON_UNKNOWN"),
    ],
)
def test_who_may_not_execute_is_told_what_is_missing(arming: Arming, who: Identity, words: str) -> None:
    """Another person is named where there must be two, and only there."""
    with pytest.raises(MessageRefused) as refused:
        check_armed(arming.now(7, 101.0), TEST, who, second_person=arming.second_person)
    reason = refused.value.refusal.values["reason"]
    assert isinstance(reason, Said)
    assert reason.words.name == words


def test_only_a_known_person_arms_what_another_one_executes() -> None:
    arming = Arming(second_person=True)
    with pytest.raises(MessageRefused, match="nobody knows whose account root is"):
        arming.arm(TEST, NOBODYS, 7, 100.0)
    assert arming.now(7, 100.0) is None
    Arming().arm(TEST, NOBODYS, 7, 100.0)
