"""What a small axis reads of its stops: a stop of a rotary table of 1 m, made by hand."""

from __future__ import annotations

import pytest

from gantryctl.engineering.stops import limits
from gantryctl.engineering.stops.certify import Certificate, QuickStops
from gantryctl.engineering.stops.run import StopClass, StopResult
from gantryctl.engineering.stops.text import certificate_lines
from gantryctl.engineering.stops.uncertain import Factors
from gantryctl.errors import ConfigError
from gantryctl.machine import configs_folder, load_machine

# It has 1.88233 N m at the motor and 56.47 N m at the reducer.
TABLE = load_machine(configs_folder() / "rotary_table.toml")
STOP = StopResult(StopClass.QUICK, 60.0, 18.5, 0.74, 19.0, 1.8712, 56.313, 1.0, 0.0, 0.026, False, 0.05, 0.8)


def test_what_a_certificate_used_is_never_rounded_above_the_limit_beside_it() -> None:
    """1.8712 N m are not "2 of 1.88233", nor 0.056313 kN m "0.1 of 0.05647"; each beside the plant that had it."""
    motor, reducer = Factors(torque_constant=0.97), Factors(stiffness=1.2)
    found = QuickStops(292.0, 0.5, Certificate(237.0, 60.0, STOP, motor, reducer, 48, 576), None)
    told = "\n".join(certificate_lines(TABLE, found))
    assert "1.871 of 1.88233 N m (torque constant -3 %)" in told
    assert "0.05631 of 0.05647 kN m (stiffness +20 %)" in told
    assert "a load of up to 75 kg m2 (50.0 % more than the machine file)" in told


def test_a_refused_quick_stop_names_the_torque_that_a_small_reducer_gets(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """61.4 N m on 56.47."""
    monkeypatch.setattr(limits, "hardest_quick_stop", lambda _: STOP._replace(torque_reducer_nm=61.4))
    with pytest.raises(ConfigError, match=r"puts 0\.0614 kN m on it, .*momentary_nm = 0\.05647 kN m"):
        limits.check_quick_stop.__wrapped__(TABLE)
