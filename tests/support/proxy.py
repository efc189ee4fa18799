"""A reverse proxy for tests: forwards the requests below one path to a port, and can cut or hold its connections."""

from __future__ import annotations

import asyncio
import contextlib
import re
import threading
from collections.abc import Iterator

PATH = "/lab/room-7/"


class Proxy:
    """Forwards `url` to a port; other paths are not found.

    While `is_cut`, it drops every connection. While it holds, connections stay open and no byte passes.
    """

    def __init__(self, port: int) -> None:
        self.port = port
        """Port to which new connections are forwarded."""
        self._loop = asyncio.new_event_loop()
        self._writers: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server | None = None
        self._is_cut = False
        self._flows = asyncio.Event()
        self._flows.set()
        self.url = ""

    @property
    def is_cut(self) -> bool:
        return self._is_cut

    @is_cut.setter
    def is_cut(self, is_cut: bool) -> None:
        self._is_cut = is_cut
        if is_cut:
            self._loop.call_soon_threadsafe(self._abort)

    def hold(self) -> None:
        """Pass nothing on, until `release`."""
        self._loop.call_soon_threadsafe(self._flows.clear)

    def release(self) -> None:
        """Pass on what came meanwhile, and go on."""
        self._loop.call_soon_threadsafe(self._flows.set)

    def run(self, is_ready: threading.Event) -> None:
        self._loop.run_until_complete(self._listen())
        is_ready.set()
        self._loop.run_forever()

    def stop(self) -> None:
        self.is_cut = True
        self._loop.call_soon_threadsafe(self._loop.stop)

    async def _listen(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.url = f"http://127.0.0.1:{self._server.sockets[0].getsockname()[1]}{PATH}"

    def _abort(self) -> None:
        for writer in list(self._writers):
            writer.transport.abort()

    async def _serve(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        if self._is_cut:
            sink.transport.abort()
            return
        self._writers.add(sink)
        with contextlib.suppress(OSError, asyncio.IncompleteReadError):
            await self._forward(source, sink)
        self._writers.discard(sink)
        sink.close()

    async def _forward(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        head = (await source.readuntil(b"\r\n\r\n")).decode("latin-1")
        method, path, _ = head.split(" ", 2)
        if not path.startswith(PATH):
            sink.write(b"HTTP/1.1 404 Not Found\r\ncontent-length: 0\r\nconnection: close\r\n\r\n")
            return
        head = head.replace(f"{method} {path}", f"{method} /{path.removeprefix(PATH)}", 1)
        if "\r\nupgrade:" not in head.lower():  # one request per connection
            head = re.sub(r"(?i)\r\nconnection:[^\r]*", "\r\nConnection: close", head)
        server_source, server_sink = await asyncio.open_connection("127.0.0.1", self.port)
        server_sink.write(head.encode("latin-1"))
        await asyncio.gather(self._copy(source, server_sink), self._copy(server_source, sink))

    async def _copy(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError):
            while data := await source.read(2**16):
                await self._flows.wait()
                sink.write(data)
                await sink.drain()
        sink.close()


@contextlib.contextmanager
def proxy(port: int) -> Iterator[Proxy]:
    """A proxy in a thread."""
    one = Proxy(port)
    is_ready = threading.Event()
    thread = threading.Thread(target=one.run, args=(is_ready,), daemon=True)
    thread.start()
    is_ready.wait()
    try:
        yield one
    finally:
        one.stop()
        thread.join()
