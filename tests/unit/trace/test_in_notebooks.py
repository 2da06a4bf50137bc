"""A trace in a notebook: data frames, a picture, a small table."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest

from gantryctl.errors import UsageError
from gantryctl.trace.table import Trace
from gantryctl.units import RAD_PER_DEG


@pytest.fixture
def trace() -> Trace:
    time_s = np.arange(100) * 0.01
    data = {"time_s": time_s, "pos_ref_rad": time_s * RAD_PER_DEG, "pos_act_rad": time_s * RAD_PER_DEG}
    return Trace(data, {"machine": "<b>axis</b>", "period_s": 0.01})


def test_data_frames_hold_every_value_and_are_copies(trace: Trace) -> None:
    for frame in (trace.to_pandas(), trace.to_polars()):
        assert isinstance(frame, pd.DataFrame | pl.DataFrame)
        assert tuple(frame.columns) == trace.columns
        for name in trace.columns:
            assert frame[name].to_numpy().tobytes() == trace[name].tobytes()
    frame = trace.to_pandas()
    assert frame.attrs["machine"] == "<b>axis</b>"
    frame.loc[0, "pos_ref_rad"] = 9.0
    assert trace["pos_ref_rad"][0] == 0.0


@pytest.mark.parametrize(("package", "method"), [("pandas", "to_pandas"), ("polars", "to_polars")])
def test_a_missing_package_is_named_with_its_command(
    trace: Trace, package: str, method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(
        UsageError, match=rf'{package} is not installed; type: pip install "gantryctl\[notebook\]"'
    ):
        getattr(trace, method)()


def test_a_picture_is_shown_and_saved(trace: Trace, tmp_path: Path) -> None:
    picture = trace.plot()
    assert picture._repr_png_().startswith(b"\x89PNG")
    assert picture.figure.axes[0].get_title(loc="left") == "Angle"
    picture.save(tmp_path / "angle.svg")
    assert (tmp_path / "angle.svg").read_text(encoding="utf-8").startswith("<?xml")
    (axes,) = trace.plot("pos_ref_rad", title="one").figure.axes
    assert axes.get_ylabel() == "deg"
    with pytest.raises(UsageError, match="no column 'speed'"):
        trace.plot("speed")
    with pytest.raises(UsageError, match=r"\.png, \.svg"):
        picture.save(tmp_path / "angle.bmp")


def test_the_table_is_small_and_escaped(trace: Trace) -> None:
    page = trace._repr_html_()
    assert "&lt;b&gt;axis" in page
    assert "<b>axis" not in page
    assert "pos_act_deg" in page
    many = Trace({"time_s": np.zeros(3), **{f"a{k}_rad": np.zeros(3) for k in range(40)}})
    assert "29 more columns" in many._repr_html_()
    assert len(many._repr_html_()) < 4000
    assert "0 rows" in Trace({"time_s": np.zeros(0)})._repr_html_()
