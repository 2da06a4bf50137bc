"""What the commands about recordings tell, of recordings written down by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gantryctl.trace.table import Trace
from support.command_line import cli, done


def moving_from(begin_s: float, vel_rad_s: float = 0.1) -> Trace:
    """At rest, and from a time on at a speed; a row each tenth of a second for three seconds."""
    time_s = np.round(np.arange(31) * 0.1, 6)
    vel = np.where(time_s >= begin_s - 1e-9, vel_rad_s, 0.0)
    pos = vel_rad_s * np.maximum(0.0, time_s - begin_s)
    return Trace({"time_s": time_s, "pos_act_rad": pos, "vel_ref_rad_s": vel}, {"period_s": 0.1})


def test_two_recordings_are_laid_over_each_other_from_their_first_motion_on(tmp_path: Path) -> None:
    """The second moves 0.6 s earlier: laid over the first they are alike, from their first row 0.06 rad apart."""
    first, second = tmp_path / "a.parquet", tmp_path / "b.parquet"
    moving_from(1.0).to_parquet(first)
    moving_from(0.4).to_parquet(second)
    told = cli("trace", "compare", first, second, "--json").json
    assert (told["aligned_by"], told["shift_s"]) == ("motion", pytest.approx(0.6))
    assert [row["largest"] for row in told["columns"]] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert (told["from_s"], told["to_s"]) == (pytest.approx(0.6), pytest.approx(3.0))
    assert (
        "the first motion of both at 1.000 s; from 0.600 s to 3.000 s"
        in done("trace", "compare", first, second).out
    )
    apart = cli("trace", "compare", first, second, "--align", "start", "--json").json
    assert apart["shift_s"] == 0.0
    # Second minus first, in degrees; the earlier one leads.
    assert apart["columns"][0]["largest"] == pytest.approx(np.degrees(0.06))


def test_the_newest_recordings_are_listed_the_newest_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GANTRYCTL_STATE", str(tmp_path))
    for machine, number, hour in (("one", 1, 10), ("two", 1, 12), ("one", 2, 11), ("one", 3, 13)):
        file = tmp_path / machine / "traces" / f"move-{number:06d}-20260301T{hour}0000000.parquet"
        file.parent.mkdir(parents=True, exist_ok=True)
        moving_from(1.0).to_parquet(file)
    rows = cli("trace", "list", "--last", "3", "--json").json
    assert [(row["machine"], row["begun"][11:13]) for row in rows] == [
        ("one", "11"),
        ("two", "12"),
        ("one", "13"),
    ]
    assert {row["duration_s"] for row in rows} == {3.0}


def test_a_reader_is_told_for_how_long_the_longest_row_at_rest_stands(tmp_path: Path) -> None:
    """Four rows of a scan of 0.1 s; the third stands for half a second, the last for a scan."""
    file = tmp_path / "rest.parquet"
    data = {"time_s": [0.0, 0.1, 0.6, 0.7], "pos_act_rad": [0.0] * 4, "spacing_s": [0.1, 0.1, 0.5, 0.1]}
    Trace({name: np.array(values) for name, values in data.items()}, {"period_s": 0.1}).to_parquet(file)
    told = done("trace", "show", file).out
    assert "1 rows are of an axis at rest and stand for up to 0.5 s each" in told
    assert "rows are missing" not in told
