"""What decides the bits of a row: who computes with another one is refused by name."""

from __future__ import annotations

import functools
import hashlib
import math
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from gantryctl.engineering.batch import ClosedLoop
from gantryctl.engineering.scheduler.one_thread import one_blas_thread
from gantryctl.machine import default_machine
from gantryctl.motion import SetPoint, plan_move
from gantryctl.units import rad
from gantryctl.wiring.program import motion_limits, position_law
from gantryctl.wiring.simulator import gantry_sim

_DIGITS: Final = 12
_PACKAGE: Final = Path(__file__).parents[2]
# Long enough for every friction element to slide and for the ring's harmonics to pass.
_MOVE_DEG: Final = 2.0


class Identity(NamedTuple):
    """Identity of the code of one process.

    Attributes:
        version: of gantryctl. sources: hash of its Python files.
        core: hash of a short run of the compiled closed loop.
        arithmetic: hash of functions of numpy and of the C library, which differ between processors and systems.
        numpy, scipy: versions of these libraries.
    """

    version: str
    sources: str
    core: str
    arithmetic: str
    numpy: str
    scipy: str

    def differences(self, other: Identity) -> str:
        """Fields in which another identity differs, with both values; "" for none."""
        pairs = zip(self._fields, self, other, strict=True)
        return ", ".join(f"{name} {theirs}, here {ours}" for name, ours, theirs in pairs if ours != theirs)


@functools.cache
def identity() -> Identity:
    """Identity of this process."""
    return Identity(
        version("gantryctl"), _sources(), _core(), _arithmetic(), version("numpy"), version("scipy")
    )


def _sources() -> str:
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0")
        # Line ends of a checkout on another system are no other program.
        digest.update(path.read_bytes().replace(b"\r\n", b"\n") + b"\0")
    return digest.hexdigest()[:_DIGITS]


def _core() -> str:
    machine = default_machine()
    plan = plan_move(SetPoint(0.0, 0.0, 0.0), rad(_MOVE_DEG), motion_limits(machine))
    log = ClosedLoop.standing_at(gantry_sim(machine), position_law(machine), 0.0).run(plan, plan.duration)
    return hashlib.sha256(b"".join(log[name].tobytes() for name in log.columns)).hexdigest()[:_DIGITS]


def _arithmetic() -> str:
    # numpy takes other routines for sine and exponential where the processor has AVX-512, with other last bits.
    x = np.linspace(-0.97, 0.97, 1003)
    wide = 40.0 * x
    matrix = np.vander(x, 33)
    with one_blas_thread():
        solved = np.linalg.lstsq(matrix, np.sin(wide), rcond=None)[0]
    found = [
        np.sin(wide), np.cos(wide), np.tan(x), np.arcsin(x), np.arctan2(x, wide), np.exp(wide), np.log(2.0 + x),
        np.hypot(x, wide), np.sqrt(1.0 + x), wide**3, solved,
        np.fft.rfft(x).view(np.float64), np.array([math.sin(v) + math.exp(v) + math.log(2.0 + v) for v in x]),
    ]  # fmt: skip
    return hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in found)).hexdigest()[
        :_DIGITS
    ]
