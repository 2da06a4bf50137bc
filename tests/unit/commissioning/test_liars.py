"""Steps that can fail: each refuses the drive that lies about what it proves, and the gantry hardly moves meanwhile.

What is judged beside the verdict is the true plant: how far the gantry was turned.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from gantryctl.commissioning import Outcome
from gantryctl.drives.faults import frame_fault
from gantryctl.drives.virtual.axis.cia402 import State
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.personality import PERSONALITIES
from unit.commissioning.virtual_commissioning import BRAKE_BY_60FE, VirtualCommissioning

pytestmark = pytest.mark.can


@pytest.fixture
def commission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> VirtualCommissioning:
    return VirtualCommissioning(tmp_path, monkeypatch)


class Lie(NamedTuple):
    """A liar, the step that must refuse it, words of the refusal, and how far the gantry may turn.

    The way is what the step itself commands until the lie shows (`stops`: 0.5 deg of ramp and 0.5 deg at 1 deg/s), the
    permitted way of the stop, and what torque off and brake take from there, rounded up.
    """

    liar: str
    step: str
    words: str
    way_deg: float
    changes: dict[str, object] | None = None


STOPS_AT_1 = 1.0
"""Way that `stops` commands at 1 deg/s before it stops, deg."""
LIES = (
    Lie("emcy-only", "silence", "still operation enabled", 0.02),
    Lie("emcy-only", "stops", "still operation enabled", STOPS_AT_1 + 0.35),
    Lie("emcy-only", "silence", "still operation enabled", 0.02, BRAKE_BY_60FE),
    Lie("stops-at-rest-only", "stops", "still operation enabled", STOPS_AT_1 + 0.35),
    Lie("fault-shown-only", "silence", "brake open", 0.02),
    Lie("fault-shown-only", "stops", "are permitted", STOPS_AT_1 + 0.5),
    Lie("brake-open-in-silence", "silence", "brake open", 0.02),
    Lie("brake-open-in-silence", "stops", "are permitted", STOPS_AT_1 + 0.5),
    Lie("heartbeat-ignored", "silence", "heartbeat silent: no EMCY, still operation enabled", 0.02),
    Lie("deadline-ignored", "silence", "process data silent: no EMCY, still operation enabled", 0.02),
    Lie("deadline-ignored", "stops", "still operation enabled", STOPS_AT_1 + 0.35),
    Lie("quick-stop-option-ignored", "stops", "605A", STOPS_AT_1 + 0.35),
    Lie("brief-quick-stop", "stops", "605A", STOPS_AT_1 + 0.35),
    Lie("no-quick-stop", "stops", "not obeyed", STOPS_AT_1 + 0.35),
    Lie("slow-quick-stop", "stops", "too long", STOPS_AT_1 + 0.45),
    Lie("hard-quick-stop", "stops", "too hard", STOPS_AT_1 + 0.35),
    Lie("follows-bit-stuck", "pdo", "follows_bit", 0.0),
    Lie("follows-bit-stuck", "silence", "follows_bit", 0.02),
    Lie("wrong-sign-at-speed", "stops", "are commanded", 0.15),
    Lie("wrong-sign-at-speed", "loop", "", 0.25),
    Lie("torque-limit-ignored", "sign", "6072 lowered to 128 N m is not heeded", 0.05),
    Lie("torque-limit-ignored", "sign", "6072 lowered to 128 N m is not heeded", 0.05, BRAKE_BY_60FE),
    Lie("position-frozen", "sign", "+0.0000 deg by position", 0.035),
    Lie("position-frozen", "velocity", "were commanded", 0.1),
    Lie("position-frozen", "stops", "were commanded", 0.3),
)


@pytest.mark.parametrize(
    "lie", LIES, ids=lambda lie: f"{lie.liar}-{lie.step}{'-60FE' if lie.changes else ''}"
)
def test_a_liar_is_refused_and_hardly_moves(commission: VirtualCommissioning, lie: Lie) -> None:
    done = commission(lie.liar, lie.step, changes=lie.changes)
    assert done.result.outcome is Outcome.FAILED, done.result.proof
    assert lie.words in done.result.proof
    assert done.way_deg <= lie.way_deg


@pytest.mark.parametrize(
    ("step", "changes"),
    [
        *((step, None) for step in sorted({lie.step for lie in LIES})),
        ("silence", BRAKE_BY_60FE),
        ("stops", BRAKE_BY_60FE),
    ],
)
def test_the_sound_drive_passes_the_same_steps(
    commission: VirtualCommissioning, step: str, changes: dict[str, object] | None
) -> None:
    result = commission("", step, changes=changes).result
    assert result.outcome is Outcome.PASSED
    if step == "stops":
        # 0.6 deg/s on 2 deg/s2 take 0.09 deg, and the rise of that with 20 deg/s3, 0.1 s, half of it at full speed:
        # 0.03 deg more. On the ramp of a move, 0.393 deg/s2, it would be 0.46 deg.
        assert result.number("jog_release_0p6_computed_deg") == pytest.approx(0.12, rel=0.01)


def test_every_liar_has_a_step_that_refuses_it() -> None:
    liars = {name for name, kind in PERSONALITIES.items() if kind.summary.startswith("lie:")}
    assert liars == {lie.liar for lie in LIES} - {
        "brief-quick-stop",
        "no-quick-stop",
    }


@pytest.mark.parametrize(
    ("quirk", "step"),
    [
        ("sdo-preop-only", "silence"),
        ("lagging", "silence"),
        ("lagging", "stops"),
        ("silent-faults", "silence"),
        ("early-enabled", "silence"),
    ],
)
def test_a_quirk_is_no_lie(commission: VirtualCommissioning, quirk: str, step: str) -> None:
    """Without SDO in OPERATIONAL the drive is seen at a SYNC after the silence, and without EMCY by its state."""
    done = commission(quirk, step)
    assert done.result.outcome is Outcome.PASSED, done.result.proof


def test_a_missing_telegram_is_bridged_and_missing_telegrams_are_not(
    commission: VirtualCommissioning,
) -> None:
    for count, outcome in ((1, Outcome.PASSED), (2, Outcome.PASSED), (12, Outcome.FAILED)):

        def drop(node: DriveNode, count: int = count) -> None:
            node.after(2_000_000, lambda: node.faults.tpdo.update({1: frame_fault("drop", count=count)}))

        result = commission("", "velocity", spoil=drop).result
        assert result.outcome is outcome, result.proof
    assert "LATE" in result.proof


def test_the_word_does_not_change_while_the_heartbeat_is_silent(commission: VirtualCommissioning) -> None:
    """A drive that leaves for any other state is not helped: no 00 before the verdict, as the old proof sent it."""
    words: list[int] = []

    def spy(node: DriveNode) -> None:
        control = node.axis.control

        def seen(word: int) -> None:
            if node.axis.state is State.FAULT:
                words.append(word)
            control(word)

        node.od.actions[0x6040, 0] = seen
        # It stays in OPERATIONAL (1029), so that the telegrams of a living controller reach it.
        node._heartbeat_lost = lambda: None
        node.stack._consumer._lost = lambda: node.axis.communication_lost(0x8130)

    assert commission("", "silence", spoil=spy).result.outcome is Outcome.PASSED
    # In the fault by the heartbeat the drive still gets the word of before.
    assert 0x0F in words


def test_what_is_not_confirmed_asks_for_the_emergency_stop(commission: VirtualCommissioning) -> None:
    """A drive that obeys no controlword goes on after "torque off": the words do not say that the torque is off."""

    def deaf(node: DriveNode) -> None:
        def never(code: int) -> None:
            node.faults.stuck_state = True

        node.axis.communication_lost = never

    done = commission("", "silence", spoil=deaf)
    assert done.result.outcome is Outcome.FAILED
    assert "commanded, not confirmed: press the emergency stop" in done.result.proof
    assert "brake closed" not in done.result.proof
