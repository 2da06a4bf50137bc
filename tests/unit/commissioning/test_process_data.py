"""Step `pdo`: telegrams against SDO, with statuswords that toggle by design, and with those that do not agree."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.cli.main import cli
from gantryctl.commissioning import Outcome
from gantryctl.commissioning.steps_bus import StatuswordSample, StatuswordVerdict, judge_statuswords
from gantryctl.drives.canopen.bus.sdo import SdoClient
from gantryctl.drives.virtual.node import DriveNode
from gantryctl.drives.virtual.side_channel.requests import Requests
from gantryctl.machine import configs_folder
from unit.commissioning.virtual_commissioning import VirtualCommissioning

pytestmark = pytest.mark.can


@pytest.fixture
def commission(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> VirtualCommissioning:
    return VirtualCommissioning(tmp_path, monkeypatch)


def test_bits_that_toggle_by_design_are_named_and_not_compared(commission: VirtualCommissioning) -> None:
    result = commission("toggling-status", "pdo").result
    assert result.outcome is Outcome.PASSED, result
    assert "agrees 8 times, bits 8, 14 change by themselves" in result.proof


def test_a_position_around_0_agrees_with_its_telegram(commission: VirtualCommissioning) -> None:
    result = commission("around-zero", "pdo", changes={"can.position_range": "around 0"}).result
    assert result.outcome is Outcome.PASSED, result


def test_another_object_in_the_place_of_the_statusword_fails(
    commission: VirtualCommissioning, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By SDO bit 9 is otherwise than in every telegram."""
    true_number = SdoClient.number

    def number(self: SdoClient, index: int, sub: int = 0) -> int:
        return true_number(self, index, sub) ^ (0x200 if index == 0x6041 else 0)

    monkeypatch.setattr(SdoClient, "number", number)
    result = commission("toggling-status", "pdo").result
    assert result.outcome is Outcome.FAILED, result
    assert "differs in bits 9" in result.proof


def test_the_telegrams_of_the_last_run_stand_in_the_status_of_the_drive(
    commission: VirtualCommissioning, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted while the axis ran; `drive status` itself exchanges none."""
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))

    def spoil(node: DriveNode) -> None:
        for kind in ("drop", "length", "duplicate"):
            fault = {"cmd": "inject", "fault": "tpdo", "tpdo": 1, "kind": kind, "amount": 3, "count": 2}
            assert Requests(node).answer(fault)["ok"]

    commission("", "pdo", spoil=spoil)
    answer = CliRunner().invoke(cli, ["drive", "status", "--config", str(configs_folder() / "hust_can.toml")])
    assert answer.exit_code == 0, answer.output
    (line,) = (line for line in answer.output.splitlines() if "TPDO 1" in line)
    assert line.startswith("  last run  TPDO 1: ")
    assert "of a wrong length" in line
    assert "until 20" in answer.output


words = st.integers(0, 0xFFFF)


@given(words, words, st.lists(st.tuples(words, words, words), min_size=2, max_size=8))
def test_what_moves_is_never_wrong_and_what_stands_is_compared(
    still: int, moving: int, chances: list[tuple[int, int, int]]
) -> None:
    samples = [StatuswordSample(*(still & ~moving | chance & moving for chance in each)) for each in chances]
    verdict = judge_statuswords(samples)
    assert verdict.moving & ~moving == 0
    # A bit that moved by SDO alone, and stood in every telegram, is wrong; no other is.
    assert verdict.wrong & ~moving == 0
    flipped = [each._replace(by_sdo=each.by_sdo ^ 0x8) for each in samples]
    assert verdict.moving & 0x8 or judge_statuswords(flipped).wrong & 0x8 or moving & 0x8


def test_a_state_that_changes_by_itself_fails() -> None:
    verdict = judge_statuswords(
        [StatuswordSample(0x240, 0x240, 0x250), StatuswordSample(0x240, 0x221, 0x221)]
    )
    assert not verdict.agree
    assert "the state itself changes (bits 0, 5, 6)" in verdict.text


@pytest.mark.parametrize(
    ("wrong", "moving", "agree", "text"),
    [
        (0, 0, True, "agrees 8 times"),
        # Bit 4, voltage enabled, is no part of the state.
        (0, 1 << 4 | 1 << 10, True, "agrees 8 times, bits 4, 10 change by themselves and are not compared"),
        (0, 1 << 3, False, "agrees 8 times, the state itself changes (bits 3)"),
        (0, 1 << 5 | 1 << 15, False,
         "agrees 8 times, the state itself changes (bits 5), bits 15 change by themselves and are not compared"),
        (1 << 2 | 1 << 11, 0, False, "differs in bits 2, 11"),
    ],
)  # fmt: skip
def test_a_verdict_on_the_statusword_names_its_bits(wrong: int, moving: int, agree: bool, text: str) -> None:
    found = StatuswordVerdict(wrong, moving, 8)
    assert (found.agree, found.text) == (agree, text)
