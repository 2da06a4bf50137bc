"""The built page: read once into memory, so that no path of a request ever reaches the file system."""

from __future__ import annotations

import gzip
import hashlib
import mimetypes
from pathlib import Path
from typing import Final, NamedTuple

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from gantryctl.gateway.guard import error
from gantryctl.program.alarms.codes import Code
from gantryctl.program.alarms.log import refusal

FOLDER: Final = Path(__file__).parent / "page"
_NOT_BUILT: Final = (
    "The operator page is not built into this installation. The service runs: commands and REST work.\n"
    "Build it from a clone with `make page`, or install a released wheel.\n"
)


class _File(NamedTuple):
    content: bytes
    packed: bytes
    kind: str
    tag: str


class Page:
    """Every file of a folder, by its path in the address."""

    def __init__(self, folder: Path = FOLDER) -> None:
        self._files = {
            "/" + path.relative_to(folder).as_posix(): _load(path)
            for path in (sorted(folder.rglob("*")) if folder.is_dir() else ())
            # A link in the folder could show any file of the machine.
            if path.is_file() and not path.is_symlink()
        }
        if "/index.html" in self._files:
            self._files["/"] = self._files["/index.html"]

    def answer(self, request: Request) -> Response:
        """A file, 404, or 503 while there is no page."""
        path = request.url.path
        found = self._files.get(path)
        if found is None:
            if path == "/":
                return PlainTextResponse(_NOT_BUILT, 503)
            return error(404, refusal(Code.SEC_12))
        # Vite puts a hash of the content into the names below /assets: such a file never changes.
        lasting = "max-age=31536000, immutable" if path.startswith("/assets/") else "no-cache"
        headers = {"etag": found.tag, "cache-control": lasting, "vary": "accept-encoding"}
        if request.headers.get("if-none-match") == found.tag:
            return Response(status_code=304, headers=headers)
        smaller = len(found.packed) < len(found.content)
        packed = smaller and "gzip" in request.headers.get("accept-encoding", "")
        if packed:
            headers["content-encoding"] = "gzip"
        return Response(found.packed if packed else found.content, 200, headers, media_type=found.kind)


def _load(path: Path) -> _File:
    content = path.read_bytes()
    kind = {".js": "text/javascript", ".webmanifest": "application/manifest+json"}.get(path.suffix)
    kind = kind or mimetypes.guess_type(path.name)[0] or "application/octet-stream"
    tag = f'"{hashlib.sha256(content).hexdigest()[:32]}"'
    return _File(content, gzip.compress(content, 9, mtime=0), kind, tag)
