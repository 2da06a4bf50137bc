"""Instruments: what each sees of a dwell, and how it errs."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gantryctl.engineering.instruments import LoadEncoder, ManualReadings, MotorSide, Tracker
from gantryctl.engineering.instruments.load_encoder import SCALE_TERMS
from gantryctl.errors import DeviceError, UsageError
from gantryctl.ports import Instrument

DWELL = (0.5, 0.4999, 0.5001)
"""Mean angles of a dwell: load, ring against its base, motor at the gantry."""


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


MAKERS: dict[str, Callable[[], Instrument]] = {
    "tracker": lambda: Tracker(2.5, 0.0, rng()),
    "load encoder": lambda: LoadEncoder(32, 0.0, 0.0, rng()),
    "motor side": MotorSide,
    "manual": lambda: ManualReadings.of([math.degrees(0.6)]),
}


@pytest.mark.parametrize(
    ("name", "seen", "load"),
    [
        ("tracker", 0.5, True),
        ("load encoder", 0.4999, True),
        ("motor side", 0.5001, False),
        ("manual", 0.6, True),
    ],
)
def test_every_instrument_sees_its_own_side(name: str, seen: float, load: bool) -> None:
    instrument = MAKERS[name]()
    assert instrument.name == name
    assert instrument.measures_load is load
    assert instrument.reading_rad(DWELL) == pytest.approx(seen, abs=1e-9)


@given(st.floats(-4.0, 4.0), st.floats(0.5, 5.0))
def test_a_tracker_without_noise_is_exact_on_every_turn(angle: float, radius: float) -> None:
    tracker = Tracker(radius, 0.0, rng())
    assert tracker.reading_rad([angle]) == pytest.approx(angle, abs=1e-15)
    x, y = tracker.point_m([angle])
    assert math.hypot(x, y) == pytest.approx(radius)


def test_tracker_noise_is_sigma_over_radius_and_repeats() -> None:
    readings = [Tracker(2.5, 10e-6, rng(4)).reading_rad([3.2]) for _ in range(2)]
    assert readings[0] == readings[1]
    tracker = Tracker(2.5, 10e-6, rng())
    errors = np.array([tracker.reading_rad([3.2]) for _ in range(4000)]) - 3.2
    assert errors.std() == pytest.approx(10e-6 / 2.5, rel=0.05)
    assert abs(errors.mean()) < 3e-7


@given(st.floats(-4.0, 4.0), st.integers(8, 28))
def test_an_encoder_rounds_to_its_step(angle: float, bits: int) -> None:
    encoder = LoadEncoder(bits, 0.0, 0.0, rng())
    reading = encoder.reading_rad([angle])
    assert abs(reading - angle) <= encoder.step_rad / 2.0 * (1.0 + 1e-6)
    assert reading / encoder.step_rad == pytest.approx(round(reading / encoder.step_rad))


def test_scale_error_is_zero_where_it_was_zeroed() -> None:
    encoder = LoadEncoder(32, 0.0, 4e-6, rng(), zero_rad=0.3)
    assert encoder.reading_rad([0.3]) == pytest.approx(0.3, abs=2e-9)

    def error(y: float) -> float:
        return 4e-6 * sum(gain * math.sin(waves * y + phase) for waves, gain, phase in SCALE_TERMS)

    assert encoder.reading_rad([1.0]) - 1.0 == pytest.approx(error(1.0) - error(0.3), abs=2e-9)


def test_encoder_noise() -> None:
    encoder = LoadEncoder(32, 2e-7, 0.0, rng())
    errors = np.array([encoder.reading_rad([1.0]) for _ in range(4000)]) - 1.0
    assert errors.std() == pytest.approx(2e-7, rel=0.05)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Tracker(0.0, 1e-5, rng()),
        lambda: Tracker(2.5, -1e-5, rng()),
        lambda: Tracker(math.nan, 0.0, rng()),
        lambda: LoadEncoder(0, 0.0, 0.0, rng()),
        lambda: LoadEncoder(26, -1.0, 0.0, rng()),
        lambda: LoadEncoder(26, 0.0, math.inf, rng()),
    ],
)
def test_impossible_instruments_are_refused(make: Callable[[], Instrument]) -> None:
    with pytest.raises(UsageError):
        make()


def test_readings_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "readings.csv"
    file.write_text(
        "\ufeff# tracker\nstop; Angle_deg ;who\n\n1;80,0001;me\n2; 90.0002 ;me\n", encoding="utf-8"
    )
    instrument = ManualReadings.from_csv(file)
    assert [math.degrees(instrument.reading_rad([0.0])) for _ in range(2)] == pytest.approx(
        [80.0001, 90.0002]
    )
    with pytest.raises(DeviceError, match="fewer readings than stops"):
        instrument.reading_rad([0.0])


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("", "empty"),
        ("angle\n1\n", "no column angle_deg"),
        ("angle_deg\nnan\n", "line 2, column angle_deg: reading 'nan'"),
        ("angle_deg\nx\n", "reading 'x'"),
        ("stop,angle_deg\n1,80,0001\n", "line 2: 3 values for 2 columns"),
    ],
)
def test_files_that_are_refused(tmp_path: Path, text: str, what: str) -> None:
    file = tmp_path / "readings.csv"
    file.write_text(text)
    with pytest.raises(UsageError, match=what):
        ManualReadings.from_csv(file)
    with pytest.raises(UsageError, match="cannot be read"):
        ManualReadings.from_csv(tmp_path / "none.csv")


def test_a_person_is_asked_until_the_reading_makes_sense() -> None:
    answers, said, asked = iter(["abc", "9.0001", "90,0001 deg"]), list[str](), list[str]()

    def ask(prompt: str) -> str:
        asked.append(prompt)
        return next(answers)

    instrument = ManualReadings.asking(ask, said.append)
    assert math.degrees(instrument.reading_rad([math.radians(90.0)])) == pytest.approx(90.0001)
    assert asked[0] == "axis at 90.0000 deg; reading, deg: "
    assert "not an angle" in said[0]
    assert "away from where the axis stands" in said[1]


def test_a_person_who_has_no_reading_ends_the_run() -> None:
    with pytest.raises(DeviceError, match="after 3 attempts"):
        ManualReadings.asking(lambda _: "", lambda _: None).reading_rad([0.0])
