"""Check of a BLF log before python-can reads it: lengths that its reader would follow in a circle, or without end."""

from __future__ import annotations

import struct
import zlib
from typing import BinaryIO, Final

# Layout as written by Vector's tools and read by python-can: head of the file, then objects; a container holds others.
_FILE_HEAD: Final = struct.Struct("<4sL")
_OBJECT_HEAD: Final = struct.Struct("<4sHHLL")
_SIGNATURE: Final = b"LOBJ"
_CONTAINER: Final = 10
_CONTAINER_HEAD: Final = 16
_DEFLATED: Final = 2
# Behind an object stand up to so many bytes before the next one.
_PADDING_MAX: Final = 8
# Writers close a container at 128 KiB; one of zlib could hold a thousand times what the file does.
_CONTAINER_MAX: Final = 16 * 1024 * 1024


def check_blf(file: BinaryIO) -> None:
    """Look at the length of every object; the file is at its beginning afterwards.

    What is cut off, or no BLF log at all, is left to the reader.

    Raises:
        ValueError: an object is shorter than its head, so that a reader would never come to the next one, or a
            container is larger than 16 MiB. zlib.error: a container cannot be unpacked.
    """
    head = file.read(_FILE_HEAD.size)
    if len(head) == _FILE_HEAD.size:
        file.seek(_FILE_HEAD.unpack(head)[1])
        left = b""
        while len(head := file.read(_OBJECT_HEAD.size)) == _OBJECT_HEAD.size:
            signature, _, _, size, kind = _OBJECT_HEAD.unpack(head)
            if signature != _SIGNATURE:
                break
            _check(size)
            data = file.read(size - _OBJECT_HEAD.size)
            file.seek(size % 4, 1)
            if kind == _CONTAINER:
                left = _behind_objects(left + _unpacked(data))
    file.seek(0)


def _unpacked(container: bytes) -> bytes:
    body = container[_CONTAINER_HEAD:]
    if container[:1] != bytes([_DEFLATED]):
        return body
    unpacker = zlib.decompressobj()
    data = unpacker.decompress(body, _CONTAINER_MAX)
    if unpacker.unconsumed_tail:
        raise ValueError(f"a container of more than {_CONTAINER_MAX // 2**20} MiB")
    return data


def _behind_objects(data: bytes) -> bytes:
    """What begins here and ends in the next container."""
    at = 0
    while True:
        begin = data.find(_SIGNATURE, at, at + _PADDING_MAX)
        if begin < 0 or begin + _OBJECT_HEAD.size > len(data):
            return data[at:]
        size = _OBJECT_HEAD.unpack_from(data, begin)[3]
        _check(size)
        if begin + size > len(data):
            return data[at:]
        at = begin + size


def _check(size: int) -> None:
    if size < _OBJECT_HEAD.size:
        raise ValueError(f"an object of {size} bytes, and its head alone has {_OBJECT_HEAD.size}")
