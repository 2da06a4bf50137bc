"""Words to systemd: ready, alive, ending. Without systemd nothing happens."""

from __future__ import annotations

import contextlib
import os
import socket


def notify(word: str) -> None:
    """Say READY, WATCHDOG or STOPPING to whoever started the service, if it wants to know."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address:
        return
    if address.startswith("@"):
        address = "\0" + address[1:]
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as made:
        made.sendto(f"{word}=1".encode(), address)
