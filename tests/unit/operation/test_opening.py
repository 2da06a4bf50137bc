"""A machine opened as the last run left it: reasons against power are values, the gravest first."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from gantryctl.machine import default_machine
from gantryctl.operation.opening import close_axis, keep_machine, new_machine, open_axis, read_only
from gantryctl.operation.run_memory import RunEnd
from gantryctl.operation.store import StateStore
from gantryctl.program import Code
from gantryctl.program.alarms.reason import ClearedBy

MACHINE = default_machine()


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    return tmp_path


def kept(turned_deg: float = 0.0, error_stop: str = "") -> StateStore:
    """A store whose gantry has turned while off."""
    found = new_machine(MACHINE, 10.0)
    rest = found.retained.rest_position_counts
    assert rest is not None
    moved = rest - round(turned_deg / found.scale.deg_per_count)
    store = StateStore(MACHINE)
    keep_machine(
        MACHINE, store, found.drive,
        replace(found.retained, rest_position_counts=moved, error_stop=error_stop),
    )  # fmt: skip
    return store


@pytest.mark.parametrize(
    ("turned_deg", "error_stop", "expected"),
    [
        (0.0, "", []),
        (0.03, "", []),
        (0.2, "", [(Code.ENC_09, ClearedBy.RESET)]),
        (4.85, "", [(Code.ENC_10, ClearedBy.RESTART)]),
        (0.0, "CTL-03", [(Code.SYS_12, ClearedBy.RESET)]),
        (0.0, "ENC-01", [(Code.SYS_12, ClearedBy.SERVICE)]),
        (0.2, "CTL-03", [(Code.ENC_09, ClearedBy.RESET), (Code.SYS_12, ClearedBy.RESET)]),
        (4.85, "CTL-03", [(Code.ENC_10, ClearedBy.RESTART), (Code.SYS_12, ClearedBy.RESET)]),
    ],
)
def test_reasons_name_their_code_and_what_clears_them(
    turned_deg: float, error_stop: str, expected: list[tuple[Code, ClearedBy]]
) -> None:
    with kept(turned_deg, error_stop) as store:
        opened = open_axis(MACHINE, store)
    assert [(reason.code, reason.cleared_by) for reason in opened.reasons] == expected


def test_a_reason_carries_its_numbers() -> None:
    with kept(turned_deg=0.2) as store:
        (reason,) = open_axis(MACHINE, store).reasons
    assert reason.values["moved_deg"] == pytest.approx(0.2, abs=1e-6)
    assert reason.text.startswith("ENC-09 · the axis moved +0.200 deg while off (limit 0.05 deg)")


def test_an_earlier_stop_by_the_encoder_casts_doubt_on_the_position() -> None:
    for code, doubted in (("ENC-01", True), ("CTL-03", False)):
        with kept(error_stop=code) as store:
            (reason,) = open_axis(MACHINE, store).reasons
        assert reason.values == {"stopped_by": code}
        assert reason.doubts_position is doubted


def test_the_axis_shows_the_angle_at_which_the_gantry_was_left() -> None:
    with kept() as store:
        opened = open_axis(MACHINE, store)
        assert opened.reading.angle_deg == pytest.approx(10.0, abs=0.005)
        close_axis(MACHINE, store, opened, RunEnd("done", None, power_ups=1, moves=2, time_s=3.0))
        with read_only(MACHINE, store) as again:
            assert again.reading.angle_deg == pytest.approx(10.0, abs=0.005)
            assert (again.retained.power_ups, again.retained.moves) == (1, 2)
            assert again.retained.last_result == "done"
