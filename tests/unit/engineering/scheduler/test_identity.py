"""Who computes other bits is known by name."""

from __future__ import annotations

import os
import subprocess
import sys

from numpy._core._multiarray_umath import __cpu_features__

from gantryctl.engineering.scheduler.identity import identity


def test_another_process_has_the_same_identity() -> None:
    code = "from gantryctl.engineering.scheduler.identity import identity; print(*identity())"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.split() == list(identity())
    assert identity().differences(identity()) == ""


def test_a_difference_is_named_with_both_values() -> None:
    other = identity()._replace(version="9.9.9", core="0123456789ab")
    assert identity().differences(other) == (
        f"version 9.9.9, here {identity().version}, core 0123456789ab, here {identity().core}"
    )


def test_other_routines_for_a_sine_are_another_arithmetic() -> None:
    """numpy without AVX-512 gives other last bits; where the processor has none, nothing changes."""
    code = "from gantryctl.engineering.scheduler.identity import identity; print(identity().arithmetic)"
    without = os.environ | {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL AVX512_SPR"}
    told = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True, env=without, check=True
    )
    assert (told.stdout.strip() != identity().arithmetic) == __cpu_features__["X86_V4"]
