"""The key of the journal: made at the first start, outside the state directory, for the service alone."""

from __future__ import annotations

import hashlib
import hmac
import os
import secrets
import stat
import string
from pathlib import Path
from typing import Final, NamedTuple

from gantryctl.errors import DeviceError
from gantryctl.files import write_whole

_BYTES: Final = 32
_OTHERS: Final = 0o077


class Key(NamedTuple):
    """A secret of 32 bytes, and what it seals (HMAC-SHA256, RFC 2104)."""

    secret: bytes

    def __repr__(self) -> str:
        """Never the secret: a log must not have it."""
        return f"Key({self.name})"

    @property
    def name(self) -> str:
        """Name by which a journal tells its key; it says nothing of the secret."""
        return self.seal("name", b"")[:16]

    def seal(self, kind: str, content: bytes) -> str:
        """Seal, hexadecimal; what was sealed as one kind is never taken for another."""
        return hmac.digest(self.secret, kind.encode() + b"\0" + content, hashlib.sha256).hex()


def read_key(path: Path) -> Key:
    """Read a key.

    Raises:
        DeviceError: there is none, it cannot be read, others may read it, or it is not 64 hexadecimal digits.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            text = file.read(1000).decode(errors="replace").strip()
    except OSError as fault:
        raise DeviceError(f"{path}: the journal's key cannot be read: {fault.strerror or fault}") from fault
    if os.name == "posix" and mode & _OTHERS:
        raise DeviceError(f"{path}: others may read the journal's key (mode {mode:o}): chmod 600 {path}")
    if len(text) != 2 * _BYTES or not set(text) <= set(string.hexdigits):
        raise DeviceError(f"{path}: not a key of {2 * _BYTES} hexadecimal digits: openssl rand -hex {_BYTES}")
    return Key(bytes.fromhex(text))


def made_key(path: Path) -> Key:
    """Read the key; make one where there is none.

    Raises:
        DeviceError: as `read_key`, or it cannot be made.
    """
    if not path.exists():
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        except OSError as fault:
            raise DeviceError(
                f"{path.parent}: the journal's key cannot be kept there: {fault.strerror or fault}; "
                "name another directory in GANTRYCTL_KEYS"
            ) from fault
        keep_key(path, Key(secrets.token_bytes(_BYTES)))
    return read_key(path)


def keep_key(path: Path, key: Key) -> None:
    """Write a key for its owner alone.

    Raises:
        DeviceError: the disk does not take it.
    """
    write_whole(path, key.secret.hex() + "\n", private=True)
