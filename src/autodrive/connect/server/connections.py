"""The connections of the web server: HTTP and WebSocket of uvicorn with time-outs and bounded memory."""

from __future__ import annotations

import asyncio
import math
import socket
import time
from collections import Counter
from collections.abc import Iterable
from typing import Any, TypeVar

from uvicorn.protocols.http.h11_impl import H11Protocol
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import Frame
from websockets.protocol import State

from autodrive.base.tcp import drop_dead_peer
from autodrive.base.token_bucket import TokenBucket

IDLE_TIMEOUT = 10.0
"""A connection without a complete request for this time [s] is closed."""
MAX_HTTP, MAX_WEBSOCKETS = 200, 200
"""Connections at most. One more takes the place of the oldest one of the address that has the most; of WebSockets only
those whose client has not said Hello."""
BUSY_AGE = 0.1
"""An HTTP connection that gets an answer counts as younger than an idle one of the same age, by this factor."""
REQUEST_RATE, REQUEST_BURST = 20.0, 200.0
"""Requests of an HTTP connection that are answered per second [Hz], and the largest burst."""
IS_CLIENT, ABORT = "autodrive.is_client", "autodrive.abort"
"""Keys of the scope of a WebSocket: whether its client has said Hello, and a function that cuts it off."""
DEAD_PEER_TIMEOUT = 60.0
"""A client that acknowledges nothing for this time [s] is disconnected."""
CLOSE_TIMEOUT = 1.0
"""A client that has not answered the end of the connection after this time [s] is disconnected."""
INVALID_DATA = 1007
"""Close code of a WebSocket (RFC 6455)."""
MAX_UNSENT = 16_384
"""Bytes that may wait in the kernel for a slow reader."""
PIECE = 8192
"""Bytes of a WebSocket that are processed at once."""
SHARE = 0.005
"""Greatest share of the time of the server's thread for a WebSocket on which more than a piece waits."""
MAX_PONGS = 2**16
"""A client that sends pings without reading is disconnected when this many bytes of answers wait."""


class HttpProtocol(H11Protocol):
    """An HTTP connection. Connections that request nothing have a time-out, and do not lock others out."""

    _timer: asyncio.TimerHandle | None = None
    _began = 0.0

    @property
    def age(self) -> float:
        """Time since its beginning or since the last answer [s], less while a request is being answered."""
        return (self.loop.time() - self._began) * (1.0 if self.is_idle else BUSY_AGE)

    @property
    def is_idle(self) -> bool:
        """Whether no request is being answered."""
        return self.cycle is None or self.cycle.response_complete

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore  # as in the base class
        """Begin the time-out, and make room among the other connections."""
        super().connection_made(transport)
        _limit_buffers(transport)
        self._limit = TokenBucket(REQUEST_RATE, REQUEST_BURST, self.loop.time())
        self._begin()
        others = [connection for connection in _open(self.connections, HttpProtocol) if connection is not self]
        if len(others) >= MAX_HTTP:
            _oldest(others, others).transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """End the time-out."""
        self._stop_timer()
        super().connection_lost(exc)

    def on_response_complete(self) -> None:
        """Restart the time-out, and read the next request; after a pause if there were too many."""
        self._limit.take(1.0)
        if delay := self._limit.delay(self.loop.time()):
            self.loop.call_later(delay, super().on_response_complete)
        else:
            super().on_response_complete()
        self._begin()

    def handle_websocket_upgrade(self, event: Any) -> None:
        """Make room among the other WebSockets, or refuse this one if all have clients."""
        self._stop_timer()
        others = _open(self.connections, WebSocketProtocol)
        strangers = [connection for connection in others if not connection.is_client]
        if len(others) < MAX_WEBSOCKETS:
            super().handle_websocket_upgrade(event)
        elif strangers:
            _oldest(strangers, others).transport.abort()
            super().handle_websocket_upgrade(event)
        else:
            self.transport.abort()

    def _begin(self) -> None:
        """The connection is idle from now on."""
        self._began = self.loop.time()
        self._start_timer()

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


class WebSocketProtocol(WebSocketsSansIOProtocol):
    """A WebSocket on which `send` returns when the bytes were written, so that the next message is chosen then.

    It reads in pieces, with pauses: a client that sends as fast as it can does not delay the others.
    """

    scope: Any = None
    _began = 0.0
    _timer: asyncio.TimerHandle | None = None
    """Ends a pause."""
    _busy = 0.0
    """Time that the latest piece took, here and in the application [s]."""
    _received = math.inf
    """When the application received its latest message [s]."""

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self._unread = bytearray()

    @property
    def age(self) -> float:
        """Time since its beginning [s]."""
        return self.loop.time() - self._began

    @property
    def is_client(self) -> bool:
        """Whether the client has said Hello."""
        return self.scope is not None and IS_CLIENT in self.scope

    def connection_made(self, transport: Any) -> None:
        """Keep the buffers small."""
        self._began = self.loop.time()
        transport.set_write_buffer_limits(high=0)
        _limit_buffers(transport)
        super().connection_made(transport)

    def handle_connect(self, event: Any) -> None:
        """Let the application cut the client off."""
        super().handle_connect(event)
        if self.scope is not None:
            self.scope[ABORT] = self.transport.abort

    def connection_lost(self, exc: Exception | None) -> None:
        """End the pause."""
        self._unread.clear()
        if self._timer is not None:
            self._timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Process the first piece of `data`; other pieces follow when the application has received its messages."""
        self._unread += data
        if self._timer is not None:  # uvicorn reads on after its close message
            self.transport.pause_reading()
        elif not self.read_paused:
            self._process_piece()

    def _process_piece(self) -> None:
        self._timer = None
        piece = bytes(self._unread[:PIECE])
        del self._unread[:PIECE]
        begin = time.perf_counter()
        super().data_received(piece)
        self._busy = time.perf_counter() - begin
        if not self.read_paused:
            self._read_on()

    def _read_on(self) -> None:
        """Process the next piece after a pause, or read on if there is none."""
        if self.transport.is_closing():
            return
        if self._unread:
            self.transport.pause_reading()
            self._timer = self.loop.call_later(self._busy / SHARE, self._process_piece)
        else:
            self.transport.resume_reading()

    async def receive(self) -> Any:
        """The next message for the application, which is done with the previous one."""
        self._busy += max(time.perf_counter() - self._received, 0.0)
        if self.read_paused and self.queue.empty():
            self.read_paused = False
            self._read_on()
        message = await self.queue.get()
        self._received = time.perf_counter()
        return message

    async def send(self, message: Any) -> None:
        """Write, and wait until the bytes were written."""
        if self.transport.is_closing():  # also while uvicorn does not know it yet, and would log a traceback
            raise ClientDisconnected
        is_last = message["type"] == "websocket.close"
        if is_last:  # before the bytes are written: a client that does not read would prevent it
            self.loop.call_later(CLOSE_TIMEOUT, self.transport.abort)
        await super().send(message)
        if not is_last:
            await self.writable.wait()

    def send_receive_event_to_app(self) -> None:
        """End the connection at a text that is not UTF-8, for which uvicorn would log a traceback."""
        try:
            if self.curr_msg_data_type == "text":
                b"".join(self.frames).decode()
        except UnicodeDecodeError:
            if self.conn.state is State.OPEN:  # only once: more such texts can be in the same packet
                self.conn.send_close(INVALID_DATA)
                self.handle_parser_exception()
        else:
            super().send_receive_event_to_app()

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


_Protocol = TypeVar("_Protocol", HttpProtocol, WebSocketProtocol)


def _open(connections: Iterable[Any], type_: type[_Protocol]) -> list[_Protocol]:
    return [
        connection
        for connection in connections
        if isinstance(connection, type_) and not connection.transport.is_closing()
    ]


def _oldest(candidates: list[_Protocol], others: list[_Protocol]) -> _Protocol:
    """The oldest one of the address that has the most of all."""
    by_address = Counter(map(_address, others))
    return max(candidates, key=lambda connection: (by_address[_address(connection)], connection.age))


def _address(protocol: HttpProtocol | WebSocketProtocol) -> str:
    return protocol.client[0] if protocol.client else ""


def _limit_buffers(transport: Any) -> None:
    """Limit the data that waits in the kernel, and disconnect clients that disappeared without closing."""
    tcp = transport.get_extra_info("socket")
    drop_dead_peer(tcp, DEAD_PEER_TIMEOUT)
    if hasattr(socket, "TCP_NOTSENT_LOWAT"):
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, MAX_UNSENT)
