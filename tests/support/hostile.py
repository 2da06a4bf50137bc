"""A process that holds connections: nothing, half a request, a whole one and then nothing; again when it is closed.

python hostile.py PORT COUNT HOST_HEADER
"""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress

PORT, COUNT, HOST = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
TEXTS = (
    b"",
    b"GET /",
    f"POST / HTTP/1.1\r\nHost: {HOST}\r\nContent-Length: 60\r\n\r\n{{".encode(),
    f"GET / HTTP/1.1\r\nHost: {HOST}\r\n\r\n".encode(),
)


async def hold(text: bytes) -> None:
    while True:
        with suppress(OSError):
            reader, writer = await asyncio.open_connection("127.0.0.1", PORT)
            writer.write(text)
            while await reader.read(65536):
                pass
            writer.close()
        await asyncio.sleep(0.2)


async def main() -> None:
    tasks = [asyncio.create_task(hold(TEXTS[n % len(TEXTS)])) for n in range(COUNT)]
    await asyncio.sleep(0.5)
    print("holding", flush=True)
    await asyncio.gather(*tasks)


asyncio.run(main())
