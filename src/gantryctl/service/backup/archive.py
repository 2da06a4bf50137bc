"""A backup as a file: a compressed tar archive whose first member says what the others are, each with its hash."""

from __future__ import annotations

import hashlib
import io
import json
import os
import tarfile
import zlib
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final, NamedTuple

from gantryctl.errors import UsageError
from gantryctl.files import unwritable

FORMAT: Final = "gantryctl backup, version 1"
_MANIFEST: Final = "manifest.json"
_MANIFEST_MOST_BYTES: Final = 2**20
_PIECE: Final = 2**20


class Content(NamedTuple):
    """Size and SHA-256 of a file in the archive."""

    size: int
    sha256: str


class Manifest(NamedTuple):
    """What a backup is of.

    Attributes:
        machine: name.
        config_file: where the machine file stood; "" for the reference gantry of the program.
        made, by, host, version: when, who, on which computer, with which version.
        secrets: password hashes and private keys are in it.
        journal: what `verify` said of the copy of the journal; "" for a whole one, or none.
        files: content by name.
    """

    machine: str
    config_file: str
    made: str
    by: str
    host: str
    version: str
    secrets: bool
    journal: str
    files: Mapping[str, Content]


def content_of(path: Path) -> Content:
    """Measure a file."""
    digest, size = hashlib.sha256(), 0
    with path.open("rb") as file:
        while piece := file.read(_PIECE):
            digest.update(piece)
            size += len(piece)
    return Content(size, digest.hexdigest())


def write_archive(path: Path, manifest: Manifest, folder: Path) -> None:
    """Write an archive of the files in a folder, for its owner alone.

    Raises:
        UsageError: there is such a file already, or no place of this name.
        DeviceError: the disk does not take it; nothing is left of it.
    """
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError:
        raise UsageError(f"{path}: is there already; a backup is never written over another one") from None
    except OSError as fault:
        raise unwritable(path, fault) from fault
    try:
        with os.fdopen(handle, "wb") as file:
            with tarfile.open(fileobj=file, mode="w:gz", compresslevel=6) as tar:
                text = _text(manifest)
                _add(tar, _MANIFEST, len(text), io.BytesIO(text))
                for name, content in manifest.files.items():
                    with (folder / name).open("rb") as source:
                        _add(tar, name, content.size, source)
            file.flush()
            os.fsync(file.fileno())
    except BaseException as fault:
        path.unlink(missing_ok=True)
        if isinstance(fault, OSError):
            raise unwritable(path, fault) from fault
        raise


def _add(tar: tarfile.TarFile, name: str, size: int, source: IO[bytes]) -> None:
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = size, 0o600
    tar.addfile(entry, source)


def read_manifest(path: Path) -> Manifest:
    """Read what a backup says of itself.

    Raises:
        UsageError: it is no backup, of another version, or damaged.
    """
    with _opened(path, _MANIFEST) as tar:
        return _manifest(path, tar)


def extract(path: Path, folder: Path) -> Manifest:
    """Write all files into an empty folder, after each was compared with its hash; return the manifest.

    Raises:
        UsageError: the archive is damaged: the file in it is named. What is in the folder then is of no use.
    """
    with _opened(path, _MANIFEST) as tar:
        manifest = _manifest(path, tar)
    missing = dict(manifest.files)
    name = next(iter(missing), _MANIFEST)
    with _opened(path, name) as tar:
        try:
            tar.next()  # the manifest
            while missing:
                name = next(iter(missing))
                entry = tar.next()
                if entry is None:
                    raise UsageError(f"{path}: damaged: {name} is missing")
                if entry.name != name or not entry.isreg() or entry.size != missing[name].size:
                    raise UsageError(f"{path}: damaged: {entry.name!a} stands where {name} should be")
                _copy(tar, entry, folder / name)
                found = content_of(folder / name)
                if found != missing.pop(name):
                    raise UsageError(
                        f"{path}: damaged: {name} has the SHA-256 {found.sha256}, the manifest says "
                        f"{manifest.files[name].sha256}"
                    )
        except (OSError, EOFError, zlib.error, tarfile.TarError, ValueError) as fault:
            raise UsageError(f"{path}: damaged at {name}: {fault}") from fault
    return manifest


def _opened(path: Path, name: str) -> tarfile.TarFile:
    try:
        return tarfile.open(path, "r:gz")
    except (EOFError, zlib.error, tarfile.TarError, ValueError) as fault:
        raise UsageError(f"{path}: not a backup, or damaged at {name}: {fault}") from fault
    except OSError as fault:
        raise UsageError(f"{path}: not a backup, or cannot be read: {fault.strerror or fault}") from fault


def _copy(tar: tarfile.TarFile, entry: tarfile.TarInfo, into: Path) -> None:
    into.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    source = tar.extractfile(entry)
    with open(into, "xb", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
        while source is not None and (piece := source.read(_PIECE)):
            file.write(piece)


def _manifest(path: Path, tar: tarfile.TarFile) -> Manifest:
    """Read and check the first member."""
    try:
        entry = tar.next()
        if entry is None or entry.name != _MANIFEST or not 0 < entry.size <= _MANIFEST_MOST_BYTES:
            raise UsageError(f"{path}: not a backup: {_MANIFEST} does not come first")
        source = tar.extractfile(entry)
        data = b"" if source is None else source.read()
        values = json.loads(data)
        if values.get("format") != FORMAT:
            raise UsageError(f"{path}: of another version: {values.get('format')!r}, wanted {FORMAT!r}")
        manifest = _manifest_of(values)
    except (
        OSError,
        EOFError,
        zlib.error,
        tarfile.TarError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
    ) as fault:
        raise UsageError(f"{path}: damaged at {_MANIFEST}: {fault}") from fault
    # The bytes must be what the content would be written as: so a changed bit shows.
    if _text(manifest) != data:
        raise UsageError(f"{path}: damaged at {_MANIFEST}: its hash does not fit")
    for name in manifest.files:
        parts = PurePosixPath(name)
        if parts.is_absolute() or ".." in parts.parts or str(parts) != name or "\0" in name:
            raise UsageError(f"{path}: {name!a} is no name of a file in a backup")
    return manifest


def _manifest_of(values: Mapping[str, Any]) -> Manifest:
    files = {str(name): Content(int(size), str(digest)) for name, (size, digest) in values["files"].items()}
    texts = {key: str(values[key]) for key in Manifest._fields if key not in ("files", "secrets")}
    return Manifest(**texts, secrets=values["secrets"] is True, files=files)


def _text(manifest: Manifest) -> bytes:
    """The manifest as it stands in the archive, with a hash over itself."""
    values = {"format": FORMAT, **manifest._asdict(), "files": dict(manifest.files)}
    digest = hashlib.sha256(json.dumps(values).encode()).hexdigest()
    return (json.dumps({**values, "sha256": digest}, indent=1) + "\n").encode()
