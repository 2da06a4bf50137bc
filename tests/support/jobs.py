"""Jobs for tests of the scheduler: rows that tell where they come from."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from gantryctl.engineering.scheduler.job import Rows


@dataclass(frozen=True)
class Squares:
    """Row k is k and its square; each row takes `row_s`."""

    row_s: float = 0.0

    pack: ClassVar[int] = 1

    def rows(self, first: int, count: int) -> Rows:
        time.sleep(self.row_s * count)
        index = np.arange(first, first + count)
        return {"index": index, "square": index.astype(float) ** 2}


@dataclass(frozen=True)
class KillsItsWorker:
    """Squares, but row `at` kills its process: once if there is a file to remember it, else always."""

    at: int
    remembered: Path | None = None

    pack: ClassVar[int] = 1

    def rows(self, first: int, count: int) -> Rows:
        if first <= self.at < first + count and not (self.remembered and self.remembered.exists()):
            if self.remembered:
                self.remembered.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return Squares().rows(first, count)


@dataclass(frozen=True)
class Fails:
    """Row `at` cannot be computed."""

    at: int

    pack: ClassVar[int] = 1

    def rows(self, first: int, count: int) -> Rows:
        if first <= self.at < first + count:
            raise ValueError(f"row {self.at}")
        return Squares().rows(first, count)
