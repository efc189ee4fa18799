"""A reverse proxy, as there is one in front of Jupyter: what it is asked for in its folder it asks another port for."""

from __future__ import annotations

import asyncio
import contextlib
import re
import threading
from collections.abc import Iterator


@contextlib.contextmanager
def proxy(port: int, folder: str) -> Iterator[str]:
    """In a thread; the URL of the folder, which ends with a slash. All else is not found."""

    async def serve(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            head = (await source.readuntil(b"\r\n\r\n")).decode("latin-1")
            method, path, _ = head.split(" ", 2)
            if not path.startswith(folder):
                sink.write(b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")
            else:
                head = head.replace(f"{method} {path}", f"{method} /{path.removeprefix(folder)}", 1)
                if "\r\nupgrade:" not in head.lower():  # one request for each connection
                    head = re.sub(r"(?i)\r\nconnection:[^\r]*", "\r\nConnection: close", head)
                inner_source, inner_sink = await asyncio.open_connection("127.0.0.1", port)
                inner_sink.write(head.encode("latin-1"))
                await asyncio.gather(_pass(source, inner_sink), _pass(inner_source, sink))
        sink.close()

    ports: list[int] = []
    is_ready = threading.Event()
    is_over = asyncio.Event()

    async def stay() -> None:
        async with await asyncio.start_server(serve, "127.0.0.1", 0) as server:
            ports.append(server.sockets[0].getsockname()[1])
            loops.append(asyncio.get_running_loop())
            is_ready.set()
            await is_over.wait()

    loops: list[asyncio.AbstractEventLoop] = []
    thread = threading.Thread(target=lambda: asyncio.run(stay()))
    thread.start()
    is_ready.wait()
    try:
        yield f"http://127.0.0.1:{ports[0]}{folder}"
    finally:
        loops[0].call_soon_threadsafe(is_over.set)
        thread.join()


async def _pass(source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
    with contextlib.suppress(OSError):
        while data := await source.read(2**16):
            sink.write(data)
            await sink.drain()
    sink.close()
