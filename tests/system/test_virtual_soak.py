"""The virtual soak: same seed, same trace, broken off or not; and each of its criteria can fail.

A day of 16 h takes four minutes of a quiet processor: `make virtual-soak`.
"""

from __future__ import annotations

import gc
import hashlib
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from gantryctl.machine import default_machine, with_values
from gantryctl.operation.store import StateStore
from gantryctl.service.memory.memory import SharedMemory
from gantryctl.service.protocol.messages import Identity
from gantryctl.service.protocol.roles import Role
from gantryctl.units import deg
from support.soak.verdict import Finding
from support.virtual_soak.calendar import dated
from support.virtual_soak.climate import (
    GEARS_S,
    Temperatures,
    at_rest,
    friction_share,
    in_use,
    machine_at,
)
from support.virtual_soak.day import date_at
from support.virtual_soak.desk import Counts, Desk
from support.virtual_soak.slices import Soak, memory_in_service, read_lines
from support.virtual_soak.verdict import judge, words

ANNA = Identity("c1", "anna", Role.OPERATOR, "console")
MACHINE = with_values(default_machine(), {"control.scan_period_ms": 10.0})


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setenv("GANTRYCTL_KEYS", str(tmp_path / "keys"))
    with ExitStack() as open_things:
        open_things.enter_context(dated(lambda: date_at(0.0)))
        memory = SharedMemory.create()
        open_things.callback(memory.close)
        store = open_things.enter_context(StateStore(MACHINE, tmp_path))
        made = Desk(MACHINE, store, memory, Counts(), hashlib.sha256(), lambda _: None)
        yield made
        made.close()


@pytest.mark.slow
def test_a_soak_that_is_broken_off_goes_on_as_if_it_had_not_been(tmp_path: Path) -> None:
    """Two short days at once, and with another process between them; the first line of each day is its trace."""
    whole, first = (
        Soak(tmp_path / "whole", 1, 10.0, used_s=1.0),
        Soak(tmp_path / "parts", 1, 10.0, used_s=1.0),
    )
    lines = list(whole.run(2))
    list(first.run(1))
    # Killed while it wrote: half of a line is left out, and its day computed again.
    with (tmp_path / "parts" / "log.jsonl").open("a") as log:
        log.write('{"kind": "day", "da')
    again = list(Soak(tmp_path / "parts", 1, 10.0, used_s=1.0).run(2))
    assert again[-1]["trace"] == lines[-1]["trace"]
    assert again[-1]["moves"] == lines[-1]["moves"] >= 4
    assert lines[0]["trace"] != lines[1]["trace"]
    kept = read_lines(tmp_path / "parts" / "log.jsonl")
    assert [line.get("day") for line in kept] == [None, 0, 1]
    assert all(each.passed is not False for each in judge(kept)), words(kept)
    with pytest.raises(SystemExit, match="another folder"):
        Soak(tmp_path / "parts", 2, 10.0, used_s=1.0)


def test_a_stop_that_nobody_caused_is_counted_with_its_code_and_the_day_goes_on(desk: Desk) -> None:
    desk.ask("take", ANNA, over=False)
    desk.power_on(ANNA)
    desk.drive.trip(0x7500)
    desk.wait(0.5)
    desk.recover(ANNA)
    assert sum(desk.counts.stops.values()) == 1
    assert len(desk.counts.troubles) == 1
    desk.ask("move", ANNA, target_deg=1.0)
    desk.until_rest()
    assert abs(deg(desk.drive.truth()[0]) - 1.0) < 0.1
    desk.ask("move", ANNA, target_deg=500.0)
    assert "refused" in desk.counts.troubles[-1]


def test_lost_counts_are_drift(desk: Desk) -> None:
    before = desk.offset_counts()
    desk.drive.sim.count_offset += desk.drive.identity().counts_per_turn / MACHINE.encoder.counts_per_turn
    assert desk.offset_counts() - before == pytest.approx(1.0, abs=1e-6)


def _line(day: int, **changes: Any) -> dict[str, Any]:
    line = {
        "kind": "day", "day": day, "machine_h": 24.0 * (day + 1), "on_s": 57_700.0,
        "stops": {}, "warnings": {}, "troubles": [],
        "told": 0,
        "stuck": "",
        "drift_counts": 0.02, "memory": [(24.0 * day + 7.0 + h, 80.0) for h in range(16)], "journal_mb": 3.0,
    }  # fmt: skip
    return {**line, **changes}


@pytest.mark.parametrize(
    ("what", "changes"),
    [
        ("nuisance stops", {"stops": {"CTL-03": 1}}),
        ("warnings", {"warnings": {"THM-01": 2}}),
        ("refusals, targets missed, days broken off", {"troubles": ["move refused"]}),
        ("refusals, targets missed, days broken off", {"stuck": "power does not come on"}),
        ("drift of the encoder", {"drift_counts": -1.0}),
        ("journal", {"journal_mb": 60.0}),
    ],
)
def test_each_criterion_fails_by_its_own_line(what: str, changes: dict[str, Any]) -> None:
    sound = [{"kind": "soak"}, *(_line(day) for day in range(12))]
    assert {each.passed for each in judge(sound)} == {True}
    failed = {each.what for each in judge([*sound, _line(12, **changes)]) if each.passed is False}
    assert failed == {what}


def test_memory_that_grows_fails_and_a_short_soak_cannot_tell() -> None:
    """0.05 MB a day are 2.1 MB in 1,000 h."""
    grows = [_line(day, memory=[(24.0 * day + 7.0, 80.0 + 0.05 * day)]) for day in range(30)]
    assert {each.what for each in judge(grows) if each.passed is False} == {"memory"}
    assert [each.what for each in judge(grows[:5]) if each.passed is None] == ["memory"]


def test_memory_of_one_controller_is_judged_hour_by_hour_once_it_is_warm() -> None:
    """1.7 kB an hour until 220 h of use are its warm-up; 2 kB an hour behind that are 2 MB."""

    def memory_of(hours: int, grows_mb_h: float) -> Finding:
        memory = [(7.0 + h, 40.0 + 0.0017 * min(h, 220) + grows_mb_h * max(0, h - 220)) for h in range(hours)]
        return next(
            each for each in judge([_line(0, memory=memory, on_s=hours * 3600.0)]) if each.what == "memory"
        )

    assert memory_of(300, 0.0005).passed is True
    assert memory_of(300, 0.002).passed is False
    assert memory_of(260, 0.0).passed is None


def test_free_tuples_are_no_growth_and_a_cycle_is() -> None:
    """Each tuple of a generator would add a block, up to 2,000 of its length; nobody collects a list in itself."""
    gc.collect()
    with memory_in_service():
        before = sys.getallocatedblocks()
        for _ in range(500):
            tuple(n for n in range(7))
        assert sys.getallocatedblocks() - before < 50
        before = sys.getallocatedblocks()
        for _ in range(1_000):
            cycle = list[Any]()
            cycle.append(cycle)
        assert sys.getallocatedblocks() - before > 900
    assert gc.isenabled()


def test_a_drifting_machine_stays_a_sound_one() -> None:
    """Friction in its band on each day, temperatures with their time constants, and every day's machine is accepted."""
    shares = [
        friction_share(seed, part, day)
        for seed in (1, 2)
        for part in ("roller", "motor")
        for day in range(420)
    ]
    assert 0.7 <= min(shares) < 0.75
    assert 1.25 < max(shares) <= 1.3
    warm = at_rest(0.0).after(GEARS_S, in_use(0.0))
    # After one time constant 63.2 % of the way.
    assert warm.gears_k - at_rest(0.0).gears_k == pytest.approx(0.632 * 3.0, abs=1e-3)
    for day in (0, 100, 416):
        machine = machine_at(MACHINE, 1, day * 86_400.0, Temperatures(1.0, 20.0))
        assert machine.plant.switches.thermal
        assert machine.plant.brake.torque_share > 0.9
