"""The start of a connection: the client's Hello, its checks, and the decoding of client messages."""

from __future__ import annotations

import asyncio
from typing import Any, Literal

import msgspec

from autodrive.base.errors import AutodriveError
from autodrive.base.version import __version__
from autodrive.protocol.codec import decode_client, encode
from autodrive.protocol.native import PROTOCOL, ClientMessage, Error, Hello

HELLO_TIMEOUT = 5.0
"""A client sends its Hello within this time [s]."""


class RefusedError(Exception):
    """The client is refused; `message` is the encoded reason, in the version of the protocol that the client speaks."""

    def __init__(self, code: Literal["message", "version", "rate"], text: str, protocol: int = PROTOCOL) -> None:
        super().__init__(text)
        if protocol == 1:  # version 1 calls this message Fault
            self.message = encode({"type": "Fault", "code": code, "text": text, "id": None})
        else:
            self.message = encode(Error(code, text))


async def receive_hello(receive: Any) -> Hello | None:
    """The client's Hello; None if it disconnected. Raises `RefusedError`."""
    try:
        async with asyncio.timeout(HELLO_TIMEOUT):
            data = await next_message(receive)
    except TimeoutError:
        raise RefusedError("message", f"no Hello was received within {HELLO_TIMEOUT:g} s") from None
    if data is None:
        return None
    try:
        hello = decoded(data)
    except AutodriveError as error:
        raise RefusedError("message", str(error)) from None
    if not isinstance(hello, Hello):
        raise RefusedError("message", f"the first message must be a Hello, not a {type(hello).__name__}")
    if hello.protocol != PROTOCOL:
        text = (
            f"this simulator (autodrive {__version__}) speaks version {PROTOCOL} of the native protocol, "
            f"not {hello.protocol}: install the same version of the simulator and of its client"
        )
        raise RefusedError("version", text, hello.protocol)
    return hello


async def next_message(receive: Any) -> bytes | str | None:
    """The next message of an ASGI WebSocket; None if it was closed."""
    event = await receive()
    if event["type"] != "websocket.receive":
        return None
    return event.get("bytes") if event.get("bytes") is not None else event["text"]


class _Numbered(msgspec.Struct):
    """The part of a Request that identifies it."""

    id: int | None = None


def id_of(data: bytes | str) -> int | None:
    """The id of a request whose content is invalid; None if the message has none."""
    try:
        return msgspec.msgpack.decode(data, type=_Numbered).id if isinstance(data, bytes) else None
    except (msgspec.DecodeError, ValueError, RecursionError):
        return None


def decoded(data: bytes | str) -> ClientMessage:
    """The decoded message. Raises `AutodriveError`."""
    if isinstance(data, str):
        raise AutodriveError("a text message was received; messages must be binary, in MessagePack")
    try:
        return decode_client(data)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise AutodriveError(f"a message was not understood: {error}") from None
