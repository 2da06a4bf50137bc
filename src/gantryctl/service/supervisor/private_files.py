"""Files with a secret: keys, and the users with the hashes of their passwords."""

from __future__ import annotations

import os
import pwd
import shlex
import stat
from pathlib import Path

from gantryctl.service.recorder.journal.places import places_of
from gantryctl.service.supervisor.users import FILE


def private_files(root: Path, directory: Path, tls_key: Path | None) -> list[Path]:
    """List the files with a secret that the service reads.

    Args:
        root: state root. directory: state directory of the machine. tls_key: private key of the page.
    """
    found = [root / FILE, directory / "opcua" / "key.pem", places_of(directory).key]
    return found if tls_key is None else [*found, tls_key]


def exposed(file: Path) -> str:
    """Say why a secret is open to others, with the command that mends it; "" for one that is not, or not there."""
    try:
        found = file.stat()
        with file.open("rb"):
            pass
    except FileNotFoundError:
        return ""
    except OSError as fault:
        return f"{file}: cannot be read: {fault.strerror or fault}"
    mine, typed = os.geteuid(), shlex.quote(str(file))
    if found.st_uid not in (0, mine):
        return f"{file}: belongs to {_name(found.st_uid)}, who can read and change it: chown {_name(mine)} {typed}"
    # The rule of PostgreSQL (ssl_key_file): 0600 of the own user, or 0640 of root with a group that may read it.
    most = 0o640 if found.st_uid == 0 else 0o600
    mode = stat.S_IMODE(found.st_mode)
    if mode & 0o077 & ~most:
        return f"{file}: mode {mode:04o}, other users can read or change it: chmod {most:04o} {typed}"
    return ""


def _name(uid: int) -> str:
    try:
        return pwd.getpwuid(uid).pw_name
    except KeyError:
        return str(uid)
