"""Doors through which files and messages of other people come in: what each is given, and the one error it may raise.

Every target takes bytes, does all of its work at once and returns; anything but the promised error that leaves it is a
finding. The same functions run under atheris and, on the kept corpus, in the fast tests.
"""

from __future__ import annotations

import io
import json
import os
import struct
import tarfile
import tempfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.cli.drive.drive import _backup_file
from gantryctl.drives.canopen.bus.link import Frame
from gantryctl.drives.canopen.bus.sdo import SdoClient
from gantryctl.drives.canopen.decoding.decoder import FrameDecoder
from gantryctl.drives.od.model import EdsError
from gantryctl.drives.od.object_table import read_object_tables
from gantryctl.drives.od.reading import parse_eds
from gantryctl.engineering.accuracy.table_csv import read_error_table
from gantryctl.engineering.campaign.reading import load_campaign
from gantryctl.engineering.comparison.drift_file import load_drift
from gantryctl.engineering.faults.injection import load_injections
from gantryctl.engineering.sizing.loading import load_sheet
from gantryctl.errors import ConfigError, DeviceError, StateError, UsageError
from gantryctl.files import indented_json
from gantryctl.machine import configs_folder, default_machine, load_machine
from gantryctl.machine.calibration import load_calibration
from gantryctl.runtime import Retained
from gantryctl.runtime.retained_store import decode as decode_retained
from gantryctl.runtime.retained_store import encode as encode_retained
from gantryctl.service.backup.archive import _MANIFEST, FORMAT, Manifest, _text, read_manifest
from gantryctl.service.protocol.messages import MessageRefused, from_record, parse
from gantryctl.service.recorder.journal.file import FIELDS
from gantryctl.service.recorder.journal.places import FILE
from gantryctl.service.recorder.journal.proof import verify
from gantryctl.service.recorder.journal.reading import read_journal
from gantryctl.trace.frames.files import SUFFIXES, read_frames
from gantryctl.trace.frames.ring import BusFrame
from gantryctl.trace.reader import read_trace

_CONFIGS: Final = configs_folder()
_DATA: Final = Path(__file__).resolve().parents[2] / "data"
_LONGEST_SDO_FRAMES: Final = 400
# A log is read frame by frame; one that is compressed may have any number of them.
_LOG_FRAMES: Final = 500


class Target(NamedTuple):
    """One door.

    Attributes:
        run: takes one input.
        promised: the only error that may leave it.
        seeds: files to start from.
        words: tokens of its language, for mutations.
    """

    run: Callable[[bytes], None]
    promised: tuple[type[Exception], ...]
    seeds: Callable[[], list[bytes]]
    words: tuple[str, ...] = ()


@lru_cache(maxsize=1)
def _folder() -> Path:
    memory = Path("/dev/shm")  # noqa: S108 - a disk would be most of the time
    return Path(tempfile.mkdtemp(prefix=f"fuzz-{os.getpid()}-", dir=memory if memory.is_dir() else None))


def _as_file(name: str, data: bytes) -> Path:
    path = _folder() / name
    path.write_bytes(data)
    return path


def _files(*patterns: str) -> Callable[[], list[bytes]]:
    def found() -> list[bytes]:
        return [
            path.read_bytes()
            for pattern in patterns
            for root in (_CONFIGS, _DATA)
            for path in sorted(root.glob(pattern))
            if path.stat().st_size < 40_000
        ]

    return found


# --- files of machines and engineering -------------------------------------------------------------------------


def _machine(data: bytes) -> None:
    load_machine(_as_file("machine.toml", data))


def _calibration(data: bytes) -> None:
    load_calibration(_as_file("x.calibration.toml", data))


def _campaign(data: bytes) -> None:
    load_campaign(_as_file("campaign.toml", data))


def _sheet(data: bytes) -> None:
    load_sheet(_as_file("sheet.toml", data))


def _drift(data: bytes) -> None:
    load_drift(_as_file("drift.toml", data), default_machine())


def _injections(data: bytes) -> None:
    # The first byte chooses the format.
    name = "faults.json" if data[:1] == b"j" else "faults.toml"
    load_injections(_as_file(name, data[1:]))


def _error_table(data: bytes) -> None:
    read_error_table(_as_file("table.csv", data), 2.5 if data[:1] == b"m" else None)


# --- drives and buses ------------------------------------------------------------------------------------------


def _eds(data: bytes) -> None:
    parse_eds(data, "fuzz.eds", 5 if data[:1] == b"5" else None)


def _object_table(data: bytes) -> None:
    read_object_tables(_as_file("objects.csv", data))


def frames_of(data: bytes) -> list[Frame]:
    """Frames of an input: two bytes identifier and length, then the data."""
    found, at = [], 0
    while at + 2 <= len(data) and len(found) < _LONGEST_SDO_FRAMES:
        head = int.from_bytes(data[at : at + 2], "little")
        length = min(head >> 11 & 15, 8)
        found.append(Frame(head & 0x7FF, data[at + 2 : at + 2 + length]))
        at += 2 + length
    return found


def as_input(frames: list[tuple[int, bytes]]) -> bytes:
    """The input that `frames_of` reads these frames from."""
    return b"".join(struct.pack("<H", can_id | len(data) << 11) + data for can_id, data in frames)


def _frames(data: bytes) -> None:
    decoder = FrameDecoder()
    for number, frame in enumerate(frames_of(data)):
        str(decoder.decode(BusFrame(0.001 * number, frame.can_id, frame.data, number % 2 == 0)))


class _Answers:
    """A link whose bus has these frames waiting; its time goes on by a millisecond with each."""

    def __init__(self, frames: list[Frame]) -> None:
        self._frames, self._time_s, self.sent = iter(frames), 0.0, 0

    def now_s(self) -> float:
        return self._time_s

    def send(self, can_id: int, data: bytes) -> bool:
        self.sent += 1
        return self.sent % 7 != 0

    def receive(self, timeout_s: float) -> Frame | None:
        frame = next(self._frames, None)
        self._time_s += timeout_s if frame is None else 0.001
        return frame

    def pause(self, seconds: float) -> None:
        self._time_s += seconds


def _sdo(data: bytes) -> None:
    if not data:
        return
    kind = data[0]
    link = _Answers(frames_of(data[1:]))
    client = SdoClient(link, 2, lambda _: None, 0.5)  # type: ignore[arg-type]
    index, sub = ((0x1018, 1), (0x6041, 0), (0x1008, 0), (0x1021, 0), (0x2000, 3))[kind % 5]
    if kind & 0x80:
        client.write(index, sub, bytes(kind & 0x7F))
    elif kind & 0x40:
        client.text(index)
    else:
        client.optional(index, sub)


def _bus_log(data: bytes) -> None:
    # The first byte chooses the format and whether it is compressed.
    kind = data[0] if data else 0
    suffix = SUFFIXES[kind % len(SUFFIXES)] + (".gz" if kind & 0x80 else "")
    for frame in islice(read_frames(_as_file(f"bus{suffix}", data[1:])), _LOG_FRAMES):
        str(frame)


# --- what a machine has kept -----------------------------------------------------------------------------------


def _retained(data: bytes) -> None:
    # A content with its own check sum gets behind the door; else the check sum is all that is tried.
    if data[:1] == b"s":
        with suppress(ValueError, RecursionError):
            body = json.loads(data[1:])
            if isinstance(body, dict):
                body = {"crc32": f"{zlib.crc32(_indented(body)):08x}", **body}
                data = _indented(body)
    decode_retained(data)


def _indented(body: object) -> bytes:
    return (indented_json(body) + "\n").encode()


@lru_cache(maxsize=8)
def _base(name: str) -> bytes:
    return (_DATA / "fuzz" / "base" / name).read_bytes()


def patched(base: bytes, patches: bytes) -> bytes:
    """A file with changes: three bytes place, one byte length, then what stands there; without a length it is cut.

    A database or a Parquet file has check sums and lengths all over: from nothing no fuzzer gets far into one, and a
    few bytes changed are what disks and people leave.
    """
    found, at = bytearray(base), 0
    while at + 4 <= len(patches):
        place, length = int.from_bytes(patches[at : at + 3], "little"), patches[at + 3]
        place %= len(found) + 1
        new = patches[at + 4 : at + 4 + length]
        if length:
            found[place : place + len(new)] = new
        else:
            del found[place:]
        at += 4 + length
    return bytes(found)


def _journal(data: bytes) -> None:
    directory = _folder() / "machine"
    directory.mkdir(exist_ok=True)
    for beside in directory.glob(f"{FILE}*"):
        beside.unlink()
    raw = data[:1] == b"r"
    (directory / FILE).write_bytes(data[1:] if raw else patched(_base("journal.sqlite"), data[1:]))
    with suppress(UsageError, DeviceError):
        verify(directory, keyed=False)
    for row in read_journal(directory):
        assert isinstance(json.loads(row.values["detail"]), dict)
        assert json.dumps(row.values)
        assert set(row.values) == set(FIELDS)


def _backup(data: bytes) -> None:
    # "t": an archive as it is; else its manifest.
    path = _folder() / "machine.backup"
    path.unlink(missing_ok=True)
    if data[:1] == b"t":
        path.write_bytes(data[1:])
    else:
        with tarfile.open(path, "w:gz", compresslevel=1) as tar:
            entry = tarfile.TarInfo(_MANIFEST)
            entry.size = len(data)
            tar.addfile(entry, io.BytesIO(data))
    read_manifest(path)


def _drive_backup(data: bytes) -> None:
    _backup_file(_as_file("drive.json", data))


def _recording(data: bytes) -> None:
    kind = data[:1]
    if kind in (b"p", b"a"):
        base = _base("parquet" if kind == b"p" else "arrow_stream")
        data = patched(base, data[1:])
    trace = read_trace(_as_file("move-1.parquet", data))
    for name in trace.columns:
        assert trace[name].ndim == 1


# --- messages --------------------------------------------------------------------------------------------------


def _message(data: bytes) -> None:
    text: str | bytes = data
    with suppress(UnicodeDecodeError):
        text = data.decode()
    parse(text)


def _record(data: bytes) -> None:
    from_record(data)


# --- seeds that are no file of the repository ------------------------------------------------------------------


def _message_seeds() -> list[bytes]:
    framed = {"seq": 1, "frame": "120-00000000000000aa", "epoch": 4}
    found: list[dict[str, object]] = [
        {"type": "take", **framed, "over": False},
        {"type": "power", **framed, "on": True},
        {"type": "jog", **framed, "lease": "00000000000000aa", "direction": "forward"},
        {"type": "move", **framed, "target_deg": 90.0, "direction": "shortest"},
        {"type": "set", **framed, "tag": "speed_setting_deg_s", "value": 3},
        {"type": "note", "seq": 2, "frame": "1-0", "line": "tea"},
        {"type": "stop", "seq": 3},
    ]
    return [json.dumps(each).encode() for each in found]


def _record_seeds() -> list[bytes]:
    return [b'["c1","anna","operator","console","",' + each + b"]" for each in _message_seeds()]


def _frame_seeds() -> list[bytes]:
    mapping = [(0x602, struct.pack("<BHBI", 0x23, 0x1A00, n, 0x60640020)) for n in range(3)]
    return [
        as_input([(0x000, b"\x01\x02"), (0x080, b""), (0x702, b"\x05"), (0x082, bytes(8))]),
        as_input([*mapping, (0x582, struct.pack("<BHB4x", 0x60, 0x1A00, 1)), (0x182, bytes(8))]),
        as_input(
            [
                (0x602, struct.pack("<BHB4x", 0x40, 0x1008, 0)),
                (0x582, struct.pack("<BHBI", 0x41, 0x1008, 0, 9)),
            ]
        ),
    ]


def _sdo_seeds() -> list[bytes]:
    long = [
        (0x582, struct.pack("<BHBI", 0x41, 0x1008, 0, 9)),
        (0x582, b"\0ABCDEFG"),
        (0x582, b"\x1bHI\0\0\0\0\0"),
    ]
    blocks = [
        (0x582, struct.pack("<BHBI", 0x41, 0x1021, 0, 70)), (0x582, struct.pack("<BHBI", 0xC6, 0x1021, 0, 70)),
        *((0x582, bytes([n | (0x80 if n == 10 else 0), *b"0123456"])) for n in range(1, 11)),
        (0x582, b"\xc1\0\0\0\0\0\0\0"),
    ]  # fmt: skip
    return [
        b"\0" + as_input([(0x582, struct.pack("<BHBI", 0x43, 0x1018, 1, 7))]),
        b"\x42" + as_input(long),
        b"\x03" + as_input(blocks),
        b"\x88" + as_input([(0x582, struct.pack("<BHB4x", 0x60, 0x1021, 0)), (0x582, b"\x20" + bytes(7))]),
        b"\x01" + as_input([(0x582, struct.pack("<BHBI", 0x80, 0x6041, 0, 0x06020000))]),
    ]


def _log_seeds() -> list[bytes]:
    return [
        b"\0(0.000000) can0 182#0102030405060708 R\n(0.001000) can0 080# T\n",
        b"\x01date Mon Nov 23 04:00:00.000 2026\nbase hex  timestamps absolute\nBegin Triggerblock\n"
        b"   0.001000 1  182             Rx   d 8 01 02 03 04 05 06 07 08\nEnd TriggerBlock\n",
        b"\x03;$FILEVERSION=1.1\n;$STARTTIME=44000.5\n   1)      1.0  Rx         0182  8  01 02 03 04 05 06 07 08\n",
        b"\x04timestamp,arbitration_id,extended,remote,error,dlc,data\n0.5,0x182,0,0,0,2,AQI=\n",
        b"\x02" + _base("frames.blf"),
    ]


def _retained_seeds() -> list[bytes]:
    whole = encode_retained(Retained(machine="gantry", config_hash="00"), 3)
    body = {name: value for name, value in json.loads(whole).items() if name != "crc32"}
    return [whole, b"s" + json.dumps(body).encode()]


def _backup_seeds() -> list[bytes]:
    whole = Manifest("gantry", "", "2026-11-23T04:00:00Z", "anna", "pc", "0.1", False, "", {})
    return [_text(whole), json.dumps({"format": FORMAT, "files": {"a": [1, "00"]}}).encode()]


def _patch_seeds(kinds: bytes) -> Callable[[], list[bytes]]:
    return lambda: [
        bytes([kind]) + patch for kind in kinds for patch in (b"", b"\x00\x10\x00\x02\x00\x01", bytes(4))
    ]


_TOML: Final = (
    "[",
    "]",
    "=",
    "\n",
    "true",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "0x",
    '"""',
    "'",
    "[[",
    "{",
    "1979-05-27",
)
_JSON: Final = ('{"', '":', "null", "NaN", "Infinity", "1e999", "[[[[", "\\ud800", "true")
TARGETS: Final[dict[str, Target]] = {
    "machine": Target(_machine, (ConfigError,), _files("*.toml"), _TOML),
    "calibration": Target(_calibration, (ConfigError,), _files("*.calibration.toml"), _TOML),
    "campaign": Target(_campaign, (ConfigError,), _files("campaigns/*.toml"), _TOML),
    "sheet": Target(_sheet, (ConfigError,), _files("requirements/*.toml"), _TOML),
    "drift": Target(_drift, (ConfigError,), _files("drifts/*.toml"), _TOML),
    "injections": Target(_injections, (UsageError,), lambda: [
        b'j{"injection": [{"where": "drive", "kind": "torque_limit", "args": {"share": 0.5}, "for_s": 2.0}]}',
        b't[[injection]]\nwhere = "drive"\nkind = "torque_limit"\nargs = { share = 0.5 }\nwhen = { after_s = 1.0 }\n',
    ], (*_TOML, *_JSON)),
    "error_table": Target(_error_table, (UsageError,), _files("examples/*.csv"), (",", ";", "\t", "nan", "base_deg")),
    "eds": Target(_eds, (EdsError,), _files("eds/*"), (
        "[1018sub1]", "[DeviceInfo]", "ParameterName=", "$NODEID+0x180", "0x", "DataType=", "CompactSubObj=",
    )),
    "object_table": Target(_object_table, (EdsError,), _files("drives/*.csv"), (",", '"', "0x", "6040")),
    "frames": Target(_frames, (), _frame_seeds),
    "sdo": Target(_sdo, (DeviceError,), _sdo_seeds),
    "bus_log": Target(_bus_log, (UsageError,), _log_seeds, ("Rx", "Tx", "#", "can0", "base hex", "Begin Triggerblock")),
    "retained": Target(_retained, (StateError,), _retained_seeds, _JSON),
    "backup": Target(_backup, (UsageError,), _backup_seeds, _JSON),
    "drive_backup": Target(_drive_backup, (UsageError,), lambda: [
        b'{"drive": {"vendor": 1}, "values": {"6085:00": "0a000000"}}',
    ], (*_JSON, "6085:00")),
    "journal": Target(_journal, (DeviceError, UsageError), _patch_seeds(b"rP")),
    "recording": Target(_recording, (UsageError, DeviceError), _patch_seeds(b"pa")),
    "message": Target(_message, (MessageRefused,), _message_seeds, (*_JSON, '"type"', '"seq"', '"frame"', '"epoch"')),
    "record": Target(_record, (ValueError,), _record_seeds, _JSON),
}  # fmt: skip
