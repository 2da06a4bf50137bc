"""Sound machines raise no alarm that nobody caused, enable only when asked, and break no invariant.

A thousand of them: `python -m pytest -m slow tests/system/test_sound_machines.py`. A seed that failed, once more:
`PYTHONPATH=tests python -m support.sound_machines --first SEED --count 1 --tell`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import pytest

import gantryctl
from gantryctl.engineering.faults.oracle.taps import Oracle
from support.sound_machines import run_sequence

pytestmark = pytest.mark.can
# Those that are slow take more than three seconds of a processor each.
FOUND = [400111, 400264, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (300062, 400177))]
"""Seeds that once failed."""


def fresh_seed() -> int:
    """First seed of a run: another one whenever the program changes, the same for everybody who runs that program."""
    program = Path(gantryctl.__file__).parent / "program"
    state = hashlib.sha256()
    for path in sorted(program.rglob("*.py")):
        state.update(path.read_bytes())
    return int.from_bytes(state.digest()[:4], "big")


# Each combination of simulator and bus with 1, 4 and 10 ms, and two more; one of them in the fast set.
FRESH = [
    pytest.param(fresh_seed() + k, marks=[pytest.mark.slow] if k else [], id=str(fresh_seed() + k))
    for k in range(8)
]


@pytest.mark.parametrize("seed", [*FOUND, *FRESH])
def test_a_sound_machine_has_no_nuisance(seed: int, oracle: Oracle) -> None:
    told = run_sequence(seed, oracle, actions=5)
    assert not told.nuisances, "\n".join((str(told), *told.done))


@pytest.mark.slow
def test_a_thousand_sound_machines(
    oracle: Oracle, evidence: Callable[[str, dict[str, object]], None]
) -> None:
    first, failed, axis_s = fresh_seed(), [], 0.0
    for seed in range(first, first + 1000):
        told = run_sequence(seed, oracle)
        oracle.forget()
        axis_s += told.axis_s
        if told.nuisances:
            print(told)
            failed.append(seed)
    print(f"seeds {first} to {first + 999}, {axis_s / 3600.0:.1f} h of axis time, failed: {failed}")
    evidence(
        "sound_machines",
        {"first_seed": first, "sequences": 1000, "axis_h": axis_s / 3600.0, "with_nuisances": len(failed)},
    )
    assert not failed
