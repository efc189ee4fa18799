"""The ASGI application: files for browsers and the WebSocket of the native protocol, under the access policy."""

from __future__ import annotations

import asyncio
import logging
import os
import re
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from uvicorn.protocols.utils import ClientDisconnected

from autodrive.base.log_throttle import LogThrottle
from autodrive.connect.server.access import AccessPolicy, is_host
from autodrive.connect.server.files import ServedFile

log = logging.getLogger(__name__)

CONTENT_POLICY = "; ".join(
    (
        "default-src 'self'",
        "img-src 'self' blob: data:",
        "media-src 'self' blob: data:",
        "worker-src 'self' blob:",
        "style-src 'self' 'unsafe-inline'",
        "script-src 'self' 'wasm-unsafe-eval'",
        "connect-src 'self' {websockets} blob: data:",
        "frame-ancestors 'self' {origins}",
        "object-src 'none'",
        "base-uri 'self'",
        "form-action 'none'",
    )
)
"""What the page may load, nothing from other hosts, and which pages may embed it. Old browsers do not treat the
WebSocket of a host as 'self'."""

HEADERS = [(b"x-content-type-options", b"nosniff"), (b"referrer-policy", b"no-referrer")]
MARK = (b"x-autodrive", b"1")
"""Tells the page that a text is an answer of the simulator and not of a proxy."""

TEXT = [(b"content-type", b"text/plain; charset=utf-8"), (b"cache-control", b"no-store"), MARK]

PUBLIC = "assets/"
"""Part of the page that everybody may read: links in the page carry no token, the content is public, and the page must
start to show why its connection is refused."""

REFUSAL_INTERVAL = 10.0
"""Refused requests of one kind are logged once in this time [s]."""

CHUNK = 2**16
"""A file is sent in parts of this size [bytes], so that a slow reader needs little memory."""

LARGE_CHUNK = 2**20
"""A recording or a film is read and sent in parts of this size [bytes]."""

Scope = dict[str, Any]
Receive = Callable[[], Awaitable[dict[str, Any]]]
Send = Callable[[dict[str, Any]], Awaitable[None]]


class WebApplication:
    """Answers requests.

    `find` returns the file of a path; `serve` accepts a WebSocket and serves its client; `download` returns a large
    file, which is read piece by piece.
    """

    def __init__(
        self,
        policy: AccessPolicy,
        find: Callable[[str], ServedFile | None],
        serve: Callable[[Scope, Receive, Send], Awaitable[None]],
        download: Callable[[str], Path | None] = lambda path: None,
    ) -> None:
        self._policy = policy
        self._find = find
        self._serve = serve
        self._download = download
        self._log_throttle = LogThrottle(REFUSAL_INTERVAL, time.monotonic)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The ASGI interface."""
        path = scope["path"].lstrip("/")
        headers = dict(scope["headers"])
        is_public = scope["type"] == "http" and path.startswith(PUBLIC)
        refusal = "" if is_public else self._policy.refusal(headers, scope["query_string"])
        if refusal and self._log_throttle.admits(refusal.partition("'")[0]):
            log.warning("server: a request was refused: %s", refusal)
        if scope["type"] == "websocket":
            await receive()
            if not refusal and path == "ws":
                await self._serve(scope, receive, send)
                return
            status, text = (403, refusal) if refusal else (404, "the WebSocket is at /ws")
            await _answer(send, status, text, prefix="websocket.http")
            raise ClientDisconnected  # otherwise uvicorn logs the answer as an error of the application
        elif refusal:
            await _answer(send, 403, refusal)
        elif path == "ws":
            await _answer(send, 426, "this is the address of a WebSocket; a proxy in between must pass WebSockets")
        elif headers.get(b"transfer-encoding") or headers.get(b"content-length", b"0") != b"0":
            await _answer(send, 400, "a request with content is not accepted", is_last=True)
        elif scope["method"] not in {"GET", "HEAD"}:
            await _answer(send, 405, "only GET and HEAD are allowed")
        else:
            has_body = scope["method"] == "GET"
            if large := self._download(path):
                await _send_large(large, send, has_body=has_body)
            else:
                await self._send_file(path, headers, send, has_body=has_body)

    async def _send_file(self, path: str, headers: dict[bytes, bytes], send: Send, *, has_body: bool) -> None:
        file = self._find(path or "index.html")
        if file is None:
            text = f"'{path}' does not exist" if path else "the page is not built: run scripts/run or scripts/page"
            await _answer(send, 404, text)
            return
        compressed = None
        if b"gzip" in headers.get(b"accept-encoding", b""):
            compressed = await asyncio.to_thread(lambda: file.compressed)
        content = compressed or file.content
        lines = [
            *file.headers,
            *HEADERS,
            (b"content-security-policy", self._content_policy(headers.get(b"host", b"").decode("latin-1"))),
            (b"content-length", str(len(content)).encode()),
            (b"vary", b"accept-encoding"),
        ]
        if compressed:
            lines.append((b"content-encoding", b"gzip"))
        await send({"type": "http.response.start", "status": 200, "headers": lines})
        for start in range(0, len(content), CHUNK) if has_body else ():
            await send({"type": "http.response.body", "body": content[start : start + CHUNK], "more_body": True})
        await send({"type": "http.response.body", "body": b""})

    def _content_policy(self, host: str) -> bytes:
        can_be_named = is_host(host) and not host.startswith("[")  # a content policy has no IPv6 addresses
        websockets = f"ws://{host} wss://{host}" if can_be_named else ""
        return CONTENT_POLICY.format(websockets=websockets, origins=" ".join(self._policy.allowed_origins)).encode()


async def _send_large(path: Path, send: Send, *, has_body: bool) -> None:
    """Send a file that the browser saves."""
    try:
        file = await asyncio.to_thread(path.open, "rb")
    except OSError as error:
        await _answer(send, 404, f"'{path.name}' cannot be read: {error.strerror}")
        return
    with file:
        size = os.fstat(file.fileno()).st_size
        lines = [
            (b"content-type", b"application/octet-stream"),
            (b"content-disposition", f'attachment; filename="{_plain(path.name)}"'.encode()),
            (b"content-length", str(size).encode()),
            (b"cache-control", b"no-store"),
            *HEADERS,
        ]
        await send({"type": "http.response.start", "status": 200, "headers": lines})
        left = size if has_body else 0
        while left > 0 and (data := await asyncio.to_thread(file.read, min(left, LARGE_CHUNK))):
            left -= len(data)
            await send({"type": "http.response.body", "body": data, "more_body": True})
    await send({"type": "http.response.body", "body": b""})


def _plain(name: str) -> str:
    """The name of a file without characters that have a meaning in a header."""
    return re.sub(r"[^\w .-]", "_", name, flags=re.ASCII)


async def _answer(send: Send, status: int, text: str, prefix: str = "http", *, is_last: bool = False) -> None:
    """`is_last`: close the connection, whose next bytes may be the content of this request."""
    body = text.encode()
    headers = [*TEXT, *HEADERS, (b"content-length", str(len(body)).encode())]
    if is_last:
        headers.append((b"connection", b"close"))
    await send({"type": f"{prefix}.response.start", "status": status, "headers": headers})
    await send({"type": f"{prefix}.response.body", "body": body})
