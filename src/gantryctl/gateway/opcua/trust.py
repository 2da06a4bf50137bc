"""The trust list of OPC UA: certificates of clients as files in two folders, read again when they change."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from asyncua.crypto.truststore import TrustStore

from gantryctl.service.memory.events import EventLog

OWN: Final = "own.der"


class TrustList:
    """`trusted/` and `revoked/` of a folder, DER or PEM. An empty list gets our own certificate.

    Attributes:
        store: the certificates that a validator compares with.
    """

    def __init__(self, folder: Path, events: EventLog) -> None:
        self._folders = [folder / "trusted", folder / "revoked"]
        for each in self._folders:
            each.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._events = events
        self._seen: object = None
        self.store = TrustStore(self._folders[:1], self._folders[1:])

    def never_empty(self, certificate: Path) -> None:
        """Put our own certificate there when there is none."""
        # cryptography refuses an empty certificate store; no client has our private key.
        trusted = self._folders[0]
        if not any(trusted.iterdir()):
            (trusted / OWN).write_bytes(certificate.read_bytes())

    async def refresh(self) -> None:
        """Read the files again if any has changed; one that cannot be read leaves the list as it was."""
        try:
            files = sorted(file for folder in self._folders for file in folder.iterdir())
            found = [(file, file.stat().st_mtime_ns, file.stat().st_size) for file in files]
        except OSError:
            return  # one has just been taken away: next time
        if found == self._seen:
            return
        first, self._seen = self._seen is None, found
        try:
            await self.store.load()
        except (ValueError, OSError) as fault:
            self._events.put(
                "service", f"OPC UA: the trust list was not read, the one before is in force: {fault}"
            )
            return
        if not first:
            self._events.put("service", f"OPC UA: the trust list was read again, {len(files)} files")
