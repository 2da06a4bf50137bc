"""The examples run as they are, and print what their text promises."""

import re
import runpy
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(capsys: pytest.CaptureFixture[str], name: str) -> str:
    """Run an example as a person would; what it printed."""
    runpy.run_path(str(EXAMPLES / name), run_name="__main__")
    return capsys.readouterr().out


def test_every_example_is_tested() -> None:
    # The example of the client runs with the service of its tests.
    text = "".join(
        path.read_text(encoding="utf-8")
        for path in (Path(__file__), Path(__file__).with_name("test_client.py"))
    )
    files = [file.name for file in EXAMPLES.glob("*.py")]
    assert files
    assert [name for name in files if name not in text] == []


def test_first_move(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "01_first_move.py")
    end = re.search(r"came to rest at ([\d.]+) deg", out)
    assert end
    # gear errors of this grade move the load by a few thousandths of a degree
    assert float(end[1]) == pytest.approx(30.0, abs=0.01)


def test_own_program(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "02_own_program.py")
    ends = [float(angle) for angle in re.findall(r"s at ([\d.]+) deg", out)]
    assert ends == pytest.approx([15.0, 15.0], abs=0.005)  # the in-position window


def test_stop_in_mid_move(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "03_stop_in_mid_move.py")
    assert "STOPPING" in out
    angles = [float(angle) for angle in re.findall(r"6\.0 deg/s +([\d.]+) deg", out)]
    assert len(angles) == 4
    assert angles == sorted(angles, reverse=True), (
        "normal, jog-release, quick and brake: each shorter than the one before"
    )


def test_accuracy_of_a_changed_plant(capsys: pytest.CaptureFixture[str]) -> None:
    out = run(capsys, "04_accuracy_of_a_changed_plant.py")
    a = {name.strip(): float(value) for name, value in re.findall(r"(.+) A = ([\d.]+) deg ", out)}
    assert a["no gear error"] < 0.6 * a["as it is"], "gear errors are most of A"
    assert a["slack gears, 0.4 mm"] > 1.15 * a["as it is"], "a slack gear is seen"
    assert a["position gain halved"] == pytest.approx(a["as it is"], rel=0.03), (
        "A does not see the loop's gain"
    )
