"""Hostile HTTP: two lengths, chunks, pipelines, headers, paths and bodies that no browser sends."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from random import Random

from gantryctl.gateway.routes import API, ROUTES
from support.fuzz.doors import STATUS, Found, Target, connected, leave, read_for
from support.fuzz.words import BYTES, damaged_bytes, hostile, mutated_object

QUIET_S = 0.3
"""Nothing more comes after this time, as a rule: an answer takes a few milliseconds."""
WHOLE = 50_000
"""Bytes that arrive at once, when they are sent at once."""
PATHS = (
    "/",
    "/assets/../../etc/passwd",
    "/%2e%2e/%2e%2e/etc/passwd",
    "/%00",
    "/%",
    "/%zz",
    "//",
    "/./",
    "/a//b",
    "/\\..\\",
    "/é",
    "/" + "a" * 4000,
    "/?" + "a=1&" * 1000,
    "*",
    "http://127.0.0.1/",
    "http://other.example/",
    "127.0.0.1:80",
    "",
    "/;x",
    "/#x",
    "/api",
    "/api/v1",
    "/api/v2/tags",
    "/api/v1/traces/../../users.json",
    "/api/v1/traces/%2e%2e%2fx",
    "/api/v1/traces/" + "9" * 300,
    "/api/v1/journal?from=" + "9" * 13,
    "/api/v1/journal?from=-1&limit=1e3",
    "/api/v1/journal?from=1&from=2",
    "/api/v1/console/" + "x" * 2000,
    "/api/v1/socket",
)
METHODS = (
    "GET",
    "POST",
    "HEAD",
    "PUT",
    "DELETE",
    "OPTIONS",
    "TRACE",
    "CONNECT",
    "PATCH",
    "get",
    "G ET",
    "",
    "PRI",
    "X" * 300,
)
# Two readers may see two bodies in each: whatever follows must not be answered.
SMUGGLED = (
    "Content-Length: 5\r\nTransfer-Encoding: chunked\r\n",
    "Transfer-Encoding: chunked\r\nContent-Length: 5\r\n",
    "Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n",
    "Transfer-Encoding: identity, chunked\r\n",
    "Transfer-Encoding: chunked, chunked\r\n",
    "Transfer-Encoding: \x0bchunked\r\n",
    "Transfer-Encoding : chunked\r\n",
    " Transfer-Encoding: chunked\r\n",
    "Transfer-Encoding:\r\n chunked\r\n",
    "Transfer-Encoding: xchunked\r\n",
    "Content-Length: 5\r\nContent-Length: 6\r\n",
    "Content-Length: +5\r\n",
    "Content-Length: -1\r\n",
    "Content-Length: 0x5\r\n",
    "Content-Length: 5, 6\r\n",
    "Content-Length: 5 5\r\n",
    "Content-Length: " + "9" * 30 + "\r\n",
    "Content-Length: ٥\r\n",
    "Content-Length:\r\n",
)
CHUNKS = (
    b"-1",
    b"ffffffffffffffff",
    b"7fffffff",
    b"5;x=" + b"y" * 300,
    b"5 ",
    b" 5",
    b"0x5",
    b"",
    b"g",
    b"5\n",
    b"00000005",
)


class Http:
    """Cases over raw connections."""

    def __init__(self, target: Target) -> None:
        self.target, self.found = target, Found()

    async def case(self, name: str, random: Random) -> None:
        kind = random.choice(
            (self._smuggle, self._chunks, self._pipeline, self._headers, self._bodies, self._damage)
        )
        data = kind(random)
        step = random.choice((len(data), len(data), len(data), 1 + len(data) // 7, 1 + len(data) // 100)) or 1
        reader, writer = await connected(
            self.target.host, self.target.port, 4096 if random.random() < 0.05 else 0
        )
        try:
            with suppress(OSError):
                await self._send(writer, data, step)
                if random.random() < 0.3 and writer.can_write_eof():
                    writer.write_eof()
            said = await read_for(reader, QUIET_S) if random.random() < 0.9 else b""
        finally:
            leave(writer, random)
        statuses = [status for each in STATUS.findall(said) if (status := int(each)) >= 200]
        kind_name = kind.__name__.strip("_")
        for status in statuses:
            self.found.answers[f"{kind_name} {status}"] += 1
            if status in {500, 502}:
                self.found.fault(name, f"{status} to {data[:300]!r}")
        if not statuses:
            self.found.answers[f"{kind_name} closed"] += 1
        # What comes with a request, before its answer, is no next request: one reader in between may see a body in it.
        if len(statuses) > 1 and step == len(data) <= WHOLE:
            self.found.fault(name, f"{len(statuses)} answers to {data[:600]!r}")
        self.found.cases += 1

    async def _send(self, writer: asyncio.StreamWriter, data: bytes, step: int) -> None:
        for at in range(0, len(data), step):
            writer.write(data[at : at + step])
            await asyncio.wait_for(writer.drain(), 5.0)
            if step < len(data):
                await asyncio.sleep(0.001)

    def _head(self, random: Random, method: str = "GET", path: str = "") -> str:
        path = path or API + random.choice(ROUTES).path.replace("{", "").replace("}", "")
        cookie = self.target.cookie(random) if random.random() < 0.8 else ""
        rows = [f"{method} {path} HTTP/1.1", f"Host: {self.target.host}:{self.target.port}"]
        rows += [f"Cookie: {cookie}"] if cookie else []
        # No POST of a login session here ends it: `logout` wants an origin, and gets none.
        rows += [f"Origin: {self.target.origin}"] if random.random() < 0.3 and "logout" not in path else []
        return "\r\n".join(rows) + "\r\n"

    def _smuggle(self, random: Random) -> bytes:
        head = self._head(random, "POST", random.choice((f"{API}/login", "/", f"{API}/tags")))
        second = self._head(random, "GET", f"{API}/health") + "\r\n"
        body = random.choice(("0\r\n\r\n", "5\r\nabcde\r\n0\r\n\r\n", "abcde", "a", ""))
        text = head + random.choice(SMUGGLED) + "\r\n" + body + second
        return text.encode("utf-8")

    def _chunks(self, random: Random) -> bytes:
        head = (
            self._head(random, "POST", f"{API}/login")
            + "Content-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
        )
        parts = []
        for _ in range(random.randrange(1, 6)):
            text = mutated_object(random, {"user": "nobody", "password": "x"}).encode(
                "utf-8", "surrogatepass"
            )[:2000]
            good = random.random() < 0.6
            size = b"%x" % len(text) if good else random.choice(CHUNKS)
            parts.append(size + b"\r\n" + text + (b"\r\n" if random.random() < 0.9 else b""))
        end = random.choice(
            (
                b"0\r\n\r\n",
                b"0\r\nX: y\r\n\r\n",
                b"0\r\nContent-Length: 5\r\n\r\n",
                b"",
                b"0\r\n" + b"X: y\r\n" * 3000,
            )
        )
        return head.encode() + b"".join(parts) + end

    def _pipeline(self, random: Random) -> bytes:
        count = random.randrange(2, 40)
        one = [
            self._head(random, random.choice(("GET", "HEAD")), random.choice((f"{API}/health", "/", "")))
            for _ in range(count)
        ]
        return "".join(each + "\r\n" for each in one).encode()

    def _headers(self, random: Random) -> bytes:
        method, path = random.choice(METHODS), random.choice(PATHS)
        version = random.choice(
            ("HTTP/1.1",) * 6 + ("HTTP/1.0", "HTTP/0.9", "HTTP/2.0", "HTTP/9.9", "http/1.1", "", "HTTP/1.1 x")
        )
        rows = [f"{method} {path} {version}".encode()]
        rows += [f"Host: {self.target.host}:{self.target.port}".encode()] if random.random() < 0.8 else []
        rows += [f"Cookie: {self.target.cookie(random)}".encode()] if random.random() < 0.7 else []
        rows += random.sample(
            [
                b"Cookie: " + b"a=b; " * 1000,
                b"Cookie: __Host-gantryctl_session=" + b"\xff" * 40,
                b"X" * 20_000 + b": y",
                b"X: " + b"y" * 15_000,
                b"Host: other.example",
                b"Host: ",
                b"Host: 127.0.0.1:1@x",
                b"Range: bytes=0-,0-,0-" + b",0-" * 500,
                b"Range: bytes=-1",
                b"Expect: 100-continue",
                b"Expect: x",
                b"Upgrade: h2c\r\nConnection: Upgrade, HTTP2-Settings",
                b"Upgrade: websocket\r\nConnection: Upgrade",
                b"Connection: close, keep-alive",
                b"Connection: " + b"x," * 3000,
                b"X-Forwarded-For: 127.0.0.1",
                b'Forwarded: for="[::1]"',
                b"X\x00: y",
                b"X: \x00",
                b": y",
                b"X",
                b"X : y",
                b" X: y",
                b"Accept-Encoding: " + b"gzip;q=1," * 800,
                b"If-None-Match: *",
                b"If-Modified-Since: x",
                b"Accept: " + b"*/*," * 3000,
                b"Content-Type: multipart/form-data; boundary=" + b"-" * 4000,
                b"Te: trailers",
                b"\xff: \xff",
                b"X: y\n: z",
                b"X: y\rz",
            ],
            random.randrange(5),
        )
        rows += [b"X-%d: y" % n for n in range(random.choice((0, 0, 0, 90, 3000)))]
        ends = random.choice((b"\r\n", b"\r\n", b"\r\n", b"\n", b"\r"))
        return ends.join(rows) + ends * 2

    def _bodies(self, random: Random) -> bytes:
        # Wrong words for nobody's account only: guesses would lock the others out, as they should.
        path = random.choice((f"{API}/login", f"{API}/login", f"{API}/tags", f"{API}/console/x"))
        text = random.choice(
            (
                mutated_object(random, {"user": "nobody", "password": "wrong wrong wrong"}),
                hostile(random),
                "x" * random.choice((0, 1, 65_536, 65_537, 300_000)),
            )
        )
        body = text.encode("utf-8", "surrogatepass") + random.choice(BYTES)
        length = len(body) + random.choice((0, 0, 0, 0, 1, -1, 100))
        rows = f"Content-Type: {random.choice(('application/json', 'text/plain', '', 'a/b; charset=utf-16'))}\r\n"
        return (
            self._head(random, "POST", path) + rows + f"Content-Length: {max(0, length)}\r\n\r\n"
        ).encode() + body

    def _damage(self, random: Random) -> bytes:
        text = self._head(random, random.choice(("GET", "POST", "HEAD")))
        data = damaged_bytes(random, (text + "Content-Length: 0\r\n\r\n").encode())
        return data[: random.randrange(1, len(data) + 1)] if random.random() < 0.3 and data else data
