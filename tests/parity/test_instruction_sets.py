"""One wheel for every processor: the instruction set is chosen at start, and the results do not show which."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from gantryctl import _core

_JOB = Path(__file__).parents[1] / "support" / "bits.py"


def _forced(isa: str) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"GANTRYCTL_ISA": isa}
    return subprocess.run(
        [sys.executable, str(_JOB)], capture_output=True, text=True, env=environment, check=False
    )


def test_every_instruction_set_gives_the_same_bytes() -> None:
    runs = [_forced(isa).stdout.split() for isa in _core.isas()]
    assert [isa for isa, _ in runs] == _core.isas()
    assert len({digest for _, digest in runs}) == 1


def test_an_unknown_instruction_set_is_refused_with_what_there_is() -> None:
    refused = _forced("avx1024")
    assert refused.returncode != 0
    assert "avx1024" in refused.stderr
    assert "baseline" in refused.stderr
