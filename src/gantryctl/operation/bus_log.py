"""Log of the bus of a machine in operation: a file that was asked for, and the frames around its alarms."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from itertools import takewhile
from pathlib import Path

from gantryctl.errors import UsageError
from gantryctl.operation.store import state_root
from gantryctl.program import Alarm, AlarmLog, Severity
from gantryctl.trace.frames.recorder import FROZEN_NAMES, FrameRecorder
from gantryctl.trace.naming import next_number, numbered, oldest_first
from gantryctl.wiring.bus_log import log_in_force, logged_links


@contextmanager
def logged_bus(file: Path | None) -> Iterator[FrameRecorder]:
    """Keep the frames of every bus that is opened within a with block.

    Args:
        file: takes every frame; its name ends in the format. Without it only the latest are kept, for alarms.
    """
    # UTC, read once: within a log only the clock of the controller counts.
    recorder = FrameRecorder(file, epoch_s=time.time() - time.monotonic())
    try:
        with logged_links(recorder):
            yield recorder
    finally:
        recorder.close()


def frozen_path(folder: Path, code: str) -> Path:
    """Path for the frames around an alarm, beside the recordings and counted with them."""
    return folder / (numbered(f"bus-{code}", next_number(folder), datetime.now(UTC)) + ".log")


def last_frozen() -> Path:
    """The newest frames around an alarm of any machine in the state directory.

    Raises:
        UsageError: there are none.
    """
    folders = [[*folder.glob(FROZEN_NAMES)] for folder in state_root().glob("**/traces")]
    newest = [oldest_first(files)[-1] for files in folders if files]
    if not newest:
        raise UsageError(
            f"no frames around an alarm under {state_root()}: none was raised on a bus yet; name a file"
        )
    return max(newest, key=lambda file: file.stat().st_mtime_ns)


def freeze(folder: Path, code: str, ago_s: float = 0.0) -> None:
    """Freeze the frames around an alarm, or a failure, in the log in force."""
    log = log_in_force()
    if log is not None:
        log.alarm(code, frozen_path(folder, code), ago_s)


class AlarmFrames:
    """Freezes the frames around the alarms of an axis.

    Args:
        folder: of the files; None where nothing is kept.
    """

    def __init__(self, alarms: AlarmLog, folder: Path | None) -> None:
        self._alarms, self._folder = alarms, folder
        self._last: Alarm | None = None

    def look(self, time_s: float) -> None:
        """Take the alarms since the last look; cheap when there are none.

        Args:
            time_s: now, on the clock of the alarms.
        """
        history = self._alarms.history
        if self._folder is None or not history or history[-1] is self._last:
            return
        fresh = list(takewhile(lambda alarm: alarm is not self._last, reversed(history)))
        self._last = history[-1]
        for alarm in reversed(fresh):
            # Refusals and remarks are no alarms.
            if alarm.severity in (Severity.WARNING, Severity.STOP):
                freeze(self._folder, str(alarm.code), max(0.0, time_s - alarm.time_s))
