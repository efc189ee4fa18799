"""The ASGI application: files for browsers, and the WebSocket of the native protocol, behind the door."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Awaitable, Callable
from typing import Any

from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from autodrive.bridge.door import Door
from autodrive.bridge.files import File

POLICY = b"; ".join(
    (
        b"default-src 'self'",
        b"img-src 'self' blob: data:",
        b"media-src 'self' blob: data:",
        b"worker-src 'self' blob:",
        b"style-src 'self' 'unsafe-inline'",
        b"script-src 'self' 'wasm-unsafe-eval'",
        b"connect-src 'self' ws: wss: blob: data:",
        b"object-src 'none'",
        b"base-uri 'self'",
        b"form-action 'none'",
    )
)
"""What the page may load: nothing of any other host. (Old browsers do not count ws: as 'self'.)"""

HEADERS = [
    (b"content-security-policy", POLICY),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
]

TEXT = [(b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store")]

PUBLIC = "assets/"
"""Of the page: what was built for everybody needs no token, which its own links do not carry."""

VANISHED = 60_000
"""Who takes nothing for so long [ms] is gone."""
WAITING = 16_384
"""Bytes that may wait in the system for a slow reader."""

Scope = dict[str, Any]
Receive = Callable[[], Awaitable[dict[str, Any]]]
Send = Callable[[dict[str, Any]], Awaitable[None]]


class Protocol(WebSocketsSansIOProtocol):
    """A WebSocket on which `send` returns when the bytes have left, so that what follows is chosen then."""

    def connection_made(self, transport: Any) -> None:
        """Keep as little as possible on the way."""
        transport.set_write_buffer_limits(high=0)
        _hurry(transport)
        super().connection_made(transport)

    async def send(self, message: Any) -> None:
        """Write, and wait until it is written."""
        await super().send(message)
        await self.writable.wait()


class Site:
    """Answers requests. `find` knows files by their path; `talk` accepts a WebSocket and has the conversation on it."""

    def __init__(
        self, door: Door, find: Callable[[str], File | None], talk: Callable[[Scope, Receive, Send], Awaitable[None]]
    ) -> None:
        self._door = door
        self._find = find
        self._talk = talk

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """As ASGI has it."""
        path = scope["path"].lstrip("/")
        headers = dict(scope["headers"])
        is_public = scope["type"] == "http" and path.startswith(PUBLIC) and self._door.token is not None
        refusal = "" if is_public else self._door.refusal(headers, scope["query_string"])
        if scope["type"] == "websocket":
            await receive()
            if not refusal and path == "ws":
                await self._talk(scope, receive, send)
                return
            status, text = (403, refusal) if refusal else (404, "the WebSocket is at /ws")
            await _answer(send, status, text, prefix="websocket.http")
            raise ClientDisconnected  # else uvicorn takes the answer for a fault of ours, and logs it
        elif refusal:
            await _answer(send, 403, refusal)
        elif scope["method"] not in {"GET", "HEAD"}:
            await _answer(send, 405, "only GET")
        else:
            await self._give(path, headers, send, has_body=scope["method"] == "GET")

    async def _give(self, path: str, headers: dict[bytes, bytes], send: Send, *, has_body: bool) -> None:
        file = self._find(path or "index.html")
        if file is None:
            what = f"there is no '{path}' here" if path else "the page was not built: run scripts/run, or npm run build"
            await _answer(send, 404, what)
            return
        packed = None
        if b"gzip" in headers.get(b"accept-encoding", b""):
            packed = await asyncio.to_thread(lambda: file.packed)
        content = packed or file.content
        its = [*file.headers, *HEADERS, (b"content-length", str(len(content)).encode()), (b"vary", b"accept-encoding")]
        if packed:
            its.append((b"content-encoding", b"gzip"))
        await send({"type": "http.response.start", "status": 200, "headers": its})
        await send({"type": "http.response.body", "body": content if has_body else b""})


async def _answer(send: Send, status: int, text: str, prefix: str = "http") -> None:
    body = text.encode()
    headers = [*TEXT, *HEADERS, (b"content-length", str(len(body)).encode())]
    await send({"type": f"{prefix}.response.start", "status": status, "headers": headers})
    await send({"type": f"{prefix}.response.body", "body": body})


def _hurry(transport: Any) -> None:
    """Let little wait in the system too, and give up who has vanished without a goodbye."""
    tcp = transport.get_extra_info("socket")
    tcp.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    if hasattr(socket, "TCP_USER_TIMEOUT"):  # Linux
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, VANISHED)
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, WAITING)
