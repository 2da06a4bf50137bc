"""Log files of a bus in the formats of python-can, by the end of their name."""

from __future__ import annotations

import glob
import gzip
import json
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from gantryctl.errors import DeviceError, UsageError
from gantryctl.trace.frames.ring import BusFrame

if TYPE_CHECKING:
    import can

# python-can is imported where it is used: it costs 60 ms.
SUFFIXES: Final = (".log", ".asc", ".blf", ".trc", ".csv")
"""candump, Vector ASC and BLF, PEAK, and the table of python-can."""
_COMPRESSED: Final = ".gz"
_CONTAINER: Final = 16 * 1024
# Characters of a line: a frame has some hundred. A compressed log of one line could fill the memory.
_LINE_MAX: Final = 4096
# What python-can and the modules below it raise for files and disks that are not as they should be.
_TROUBLE: Final = (
    OSError,
    ValueError,
    LookupError,
    TypeError,
    ArithmeticError,
    EOFError,
    struct.error,
    zlib.error,
)


def check_log_name(path: Path) -> Path:
    """Return the path of a log to be written.

    Raises:
        UsageError: the end of the name is no format, or there is no such folder.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: the end of the name is the format of the log: {', '.join(SUFFIXES)}")
    if not path.parent.is_dir():
        raise UsageError(f"{path}: there is no folder {path.parent}")
    return path


def logs_beside(path: Path) -> list[Path]:
    """Parts of a log that are there, the oldest first: NAME.log, NAME-2.log, NAME-3.log ..."""
    found = {1: path} if path.exists() else {}
    for part in path.parent.glob(f"{glob.escape(path.stem)}-*{path.suffix}"):
        number = part.stem.removeprefix(f"{path.stem}-")
        if number.isascii() and number.isdigit():
            found[int(number)] = part
    return [found[number] for number in sorted(found)]


def next_log(path: Path) -> Path:
    """Path of the next part of a log: `path` itself where there is none."""
    parts = logs_beside(path)
    if not parts:
        return path
    number = parts[-1].stem.removeprefix(path.stem).removeprefix("-")
    return path.with_name(f"{path.stem}-{int(number or 1) + 1}{path.suffix}")


class FrameFile:
    """Log file under way.

    Args:
        path: the end of its name is the format; a file that is there is replaced.
        channel: name of the bus in a candump log.

    Raises:
        DeviceError: the file cannot be written; from every method.
    """

    def __init__(self, path: Path, channel: str) -> None:
        import can

        self.path = path
        # ASC and BLF count channels from 1; candump names the interface.
        named = path.suffix.lower() == ".log"
        self._dated = path.suffix.lower() != ".asc"
        # What a kill costs of a BLF file: python-can hands it to the system container by container.
        options = {"max_container_size": _CONTAINER} if path.suffix.lower() == ".blf" else {}
        try:
            self._writer: Any = can.Logger(str(path), channel=channel if named else 1, **options)
        except (can.CanError, *_TROUBLE) as fault:
            raise _unwritable(path, fault) from fault

    def write(self, frame: BusFrame) -> None:
        """Append one frame."""
        import can

        message = can.Message(
            timestamp=frame.time_s,
            arbitration_id=frame.can_id,
            data=frame.data,
            is_extended_id=False,
            is_rx=not frame.sent,
        )
        try:
            if not self._dated:
                self._date(frame.time_s)
            self._writer.on_message_received(message)
        except (can.CanError, *_TROUBLE) as fault:
            raise _unwritable(self.path, fault) from fault

    def _date(self, time_s: float) -> None:
        """Write the head of an ASC file with the date of the first frame."""
        # python-can writes the date at which the file was made: two runs with one seed would differ.
        when = datetime.fromtimestamp(time_s)
        date = when.strftime(f"%a %b %d %H:%M:%S.{when.microsecond // 1000:03d} %Y")
        file = self._writer.file
        file.seek(0)
        file.truncate()
        file.write(f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n")
        self._dated = True

    def flush(self) -> None:
        """Hand what was written to the system: from then on it survives a kill of this process."""
        flush = getattr(getattr(self._writer, "file", None), "flush", None)
        try:
            if flush is not None:
                flush()
        except _TROUBLE as fault:
            raise _unwritable(self.path, fault) from fault

    def give_up(self) -> None:
        """Close a file that cannot be written."""
        with suppress(*_TROUBLE):
            self._writer.file.close()

    def close(self) -> None:
        """Finish the file."""
        import can

        try:
            self._writer.stop()
        except (can.CanError, *_TROUBLE) as fault:
            raise _unwritable(self.path, fault) from fault


def _unwritable(path: Path, fault: BaseException) -> DeviceError:
    text = fault.strerror if isinstance(fault, OSError) and fault.strerror else str(fault)
    return DeviceError(f"{path}: cannot be written: {text}")


def read_frames(path: Path) -> Iterator[BusFrame]:
    """Read a log of this or another program; frames that are no classic data frames with 11 bits are left out.

    Raises:
        UsageError: there is no such file, its format is not known, or it is damaged: then the frames before the
            damage were given.
    """
    import can
    from can.io.blf import BLFParseError  # no CanError

    from gantryctl.trace.frames.blf import check_blf

    if not path.is_file():
        raise UsageError(f"{path}: there is no such file")
    suffix = path.with_suffix("").suffix if path.suffix.lower() == _COMPRESSED else path.suffix
    if suffix.lower() not in SUFFIXES:
        raise UsageError(f"{path}: the end of the name is the format of the log: {', '.join(SUFFIXES)}")
    count = 0
    try:
        with _opened(path, suffix.lower()) as file:
            if suffix.lower() == ".blf":
                check_blf(file)
            for message in _reader(suffix.lower(), file):
                count += 1
                plain = not (message.is_extended_id or message.is_remote_frame or message.is_error_frame)
                if plain and not message.is_fd:
                    yield BusFrame(
                        message.timestamp, message.arbitration_id, bytes(message.data), not message.is_rx
                    )
    except (can.CanError, BLFParseError, *_TROUBLE) as fault:
        text = str(fault) or type(fault).__name__
        raise UsageError(f"{path}: no whole log, damaged after {count} frames: {text}") from fault
    if not count:
        raise UsageError(f"{path}: no frame in it: is it the log of a CAN bus?")


def _opened(path: Path, suffix: str) -> Any:
    """Open a log, compressed or not."""
    how: Any = gzip.open if path.suffix.lower() == _COMPRESSED else open
    # Other programs write names and comments in the encoding of their country.
    text = {} if suffix == ".blf" else {"encoding": "utf-8-sig", "errors": "replace"}
    return how(path, "rt" if text else "rb", **text)


def _reader(suffix: str, file: Any) -> Iterator[can.Message]:
    import can

    readers: dict[str, Any] = {
        ".log": can.CanutilsLogReader,
        ".asc": can.ASCReader,
        ".blf": can.BLFReader,
        ".trc": can.TRCReader,
        ".csv": can.CSVReader,
    }
    return iter(readers[suffix](file if suffix == ".blf" else _Lines(file)))


class _Lines:
    """Lines of a text file, none longer than a log can have; what readers of python-can ask of a file.

    Raises:
        ValueError: a line is longer.
    """

    def __init__(self, file: Any) -> None:
        self._file = file

    def __iter__(self) -> Iterator[str]:
        return self

    def __next__(self) -> str:
        line: str = self._file.readline(_LINE_MAX + 1)
        if not line:
            raise StopIteration
        if len(line) > _LINE_MAX:
            raise ValueError(f"a line of more than {_LINE_MAX} characters")
        return line

    def close(self) -> None:
        """Close the file."""
        self._file.close()


# --- alarms beside a frozen log ----------------------------------------------------------------------------------


def alarms_file(log: Path) -> Path:
    """Path of the alarms that belong to a frozen log."""
    return log.with_suffix(".json")


def write_alarms(log: Path, alarms: list[tuple[str, float]]) -> None:
    """Write code and time of the alarms, on the clock of the log, beside it.

    Raises:
        DeviceError: the file cannot be written.
    """
    rows = [{"code": code, "time_s": time_s} for code, time_s in alarms]
    try:
        alarms_file(log).write_text(json.dumps({"alarms": rows}) + "\n", encoding="utf-8")
    except OSError as fault:
        raise _unwritable(alarms_file(log), fault) from fault


def read_alarms(log: Path) -> list[tuple[str, float]]:
    """Read code and time of the alarms of a frozen log; [] for any other."""
    try:
        rows = json.loads(alarms_file(log).read_text(encoding="utf-8"))["alarms"]
        return [(str(row["code"]), float(row["time_s"])) for row in rows]
    except (OSError, ValueError, KeyError, TypeError):
        return []
