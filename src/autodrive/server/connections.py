"""The connections of the web server: HTTP and WebSocket of uvicorn with time-outs and bounded memory."""

from __future__ import annotations

import asyncio
import socket
from collections import Counter
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame

from autodrive.protocol.tcp_options import drop_dead_peer

IDLE_TIMEOUT = 10.0
"""A connection without a complete request for this time [s] is closed."""
MAX_HTTP, MAX_WEBSOCKETS = 200, 200
"""Connections at most. One more HTTP connection takes the place of an idle one, of the address that has the most."""
DEAD_PEER_TIMEOUT = 60.0
"""A client that acknowledges nothing for this time [s] is disconnected."""
CLOSE_TIMEOUT = 1.0
"""A client that has not answered the end of the connection after this time [s] is disconnected."""
MAX_UNSENT = 16_384
"""Bytes that may wait in the kernel for a slow reader."""
MAX_PONGS = 2**16
"""A client that sends pings without reading is disconnected when this many bytes of answers wait."""


class HttpProtocol(H11Protocol):
    """An HTTP connection. Connections that request nothing have a time-out, and do not lock others out."""

    _timer: asyncio.TimerHandle | None = None

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore  # as in the base class
        """Begin the time-out, and make room among the idle connections."""
        super().connection_made(transport)
        _limit_buffers(transport)
        self._start_timer()
        others = [one for one in self.connections if isinstance(one, HttpProtocol) and not one.transport.is_closing()]
        if len(others) > MAX_HTTP:
            by_address = Counter(_address(one) for one in others)
            idle = [one for one in others if one.is_idle and one is not self]
            victim = max(idle, key=lambda one: (by_address[_address(one)], one._age()), default=self)
            victim.transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the time-out."""
        self._stop_timer()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Restart the time-out."""
        super().on_response_complete()
        self._start_timer()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Refuse the WebSocket if there are too many."""
        self._stop_timer()
        if sum(isinstance(one, WebSocketProtocol) for one in self.connections) >= MAX_WEBSOCKETS:
            self.transport.abort()
        else:
            super().handle_websocket_upgrade(event)

    def _start_timer(self) -> None:
        self._stop_timer()
        self._timer = self.loop.call_later(IDLE_TIMEOUT, self._on_timeout)

    def _stop_timer(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _on_timeout(self) -> None:
        if self.is_idle:
            self.transport.abort()
        else:
            self._start_timer()

    def _age(self) -> float:
        """The greater, the longer it has been idle."""
        return -self._timer.when() if self._timer is not None else 0.0


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """A WebSocket on which `send` returns when the bytes were written, so that the next message is chosen then."""

    def connection_made(self, transport: Any) -> None:
        """Keep the buffers small."""
        transport.set_write_buffer_limits(high=0)
        _limit_buffers(transport)
        super().connection_made(transport)

    async def send(self, message: Any) -> None:
        """Write, and wait until the bytes were written."""
        await super().send(message)
        if message["type"] == "websocket.close":
            self.loop.call_later(CLOSE_TIMEOUT, self.transport.abort)
        else:
            await self.writable.wait()

    def handle_cont(self, event: Frame) -> None:
        """Drop empty fragments, which no limit of the length of messages counts."""
        if event.data or event.fin:
            super().handle_cont(event)

    def handle_ping(self) -> None:
        """Answer, unless the client does not read the answers."""
        if self.transport.get_write_buffer_size() > MAX_PONGS:
            self.transport.abort()
        else:
            super().handle_ping()


def _address(protocol: HttpProtocol) -> str:
    return protocol.client[0] if protocol.client else ""


def _limit_buffers(transport: Any) -> None:
    """Limit the data that waits in the kernel, and disconnect clients that disappeared without closing."""
    tcp = transport.get_extra_info("socket")
    drop_dead_peer(tcp, DEAD_PEER_TIMEOUT)
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT)
