"""A WebSocket to the simulator over a plain socket, without threads; every wait has a time limit."""

from __future__ import annotations

import ipaddress
import selectors
import socket
import ssl
import time
from contextlib import suppress
from dataclasses import dataclass
from urllib.parse import parse_qs, urlencode, urlsplit

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidStatus
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

from autodrive.base.errors import AutodriveError
from autodrive.base.tcp import address_text
from autodrive.protocol.native import SUBPROTOCOL
from autodrive.protocol.ports import PORT

LARGEST = 2**26
"""Longest message [bytes]."""
KEPT = 2**18
"""Receive buffer of the kernel [bytes]; the simulator sends no more until the script reads."""
MANY = 1000
"""Most messages read at once, so that reading ends when messages come faster than they are read."""
GOODBYE = 0.5
"""Longest wait for the other side to close [s]."""

_NOT_NOW = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class NoSimulatorError(AutodriveError, ConnectionError):
    """No simulator was found, or the connection to it was lost."""


class NotListeningError(NoSimulatorError):
    """Nothing listens at the address: a simulator may start there soon."""


@dataclass(frozen=True)
class Address:
    """Address of a simulator; `path` is the path of its page."""

    host: str
    port: int
    path: str = "/"
    token: str | None = None
    is_secure: bool = False

    @staticmethod
    def of(text: str, token: str | None = None) -> Address:
        """'127.0.0.1:8730', '[::1]:8730', 'lab-pc', 'http://host:port/?token=...', also of a proxy ('https://hub/user/proxy/8730/')."""
        with suppress(ValueError):
            text = f"[{ipaddress.IPv6Address(str(text))}]"  # a number is no address
        try:
            has_scheme = "://" in text
            parts = urlsplit(text if has_scheme else f"http://{text}")
            host, port = parts.hostname, parts.port
        except (ValueError, TypeError):
            host = port = None
            has_scheme, parts = False, urlsplit("")
        if not host or parts.scheme not in {"http", "https", "ws", "wss"}:
            raise AutodriveError(
                f"'{text}' is not the address of a simulator; use '127.0.0.1:{PORT}' or the link that the simulator "
                "prints"
            )
        is_secure = parts.scheme in {"https", "wss"}
        usual = (443 if is_secure else 80) if has_scheme else PORT
        path = parts.path.removesuffix("ws") or "/"
        token_of_link = parse_qs(parts.query).get("token", [None])[0]
        return Address(
            host, port or usual, path if path.endswith("/") else path + "/", token or token_of_link, is_secure
        )

    @property
    def uri(self) -> str:
        """URI of the WebSocket."""
        query = f"?{urlencode({'token': self.token})}" if self.token else ""
        return f"{'wss' if self.is_secure else 'ws'}://{self}{self.path}ws{query}"

    def __str__(self) -> str:
        return address_text(self.host, self.port)


class ClientSocket:
    """A WebSocket, connected when it is created. Raises `NoSimulatorError` if no simulator listens or it disconnects.

    Any other `AutodriveError` means that the simulator refuses this client.
    """

    def __init__(self, address: Address, timeout: float) -> None:
        self._address = address
        self._timeout = timeout
        self._protocol = ClientProtocol(parse_uri(address.uri), subprotocols=[SUBPROTOCOL], max_size=LARGEST)  # type: ignore[list-item]
        self._part = b""  # received fragments of a message
        self._is_open = False
        self._is_ended = False
        self.pongs = 0
        """Number of pongs received."""
        self._socket = self._connected()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._socket, selectors.EVENT_READ)
        try:
            self._shake_hands()
        except BaseException:
            self._drop()
            raise
        self._is_open = True

    def send(self, *messages: bytes) -> None:
        """Send messages now, together."""
        if not self._is_usable:
            raise self._lost()
        for message in messages:
            self._protocol.send_binary(message)
        self._write()

    def receive(self, timeout: float) -> list[bytes]:
        """Received messages; waits at most `timeout` [s] for the first, empty if there is none."""
        messages = self._read()
        if messages or timeout <= 0:
            return messages
        end = time.monotonic() + timeout
        while not messages and (left := end - time.monotonic()) > 0:
            self._selector.select(left)
            messages = self._read()
        return messages

    def ping(self) -> None:
        """Send a ping; its pong comes after the answers to all earlier messages."""
        if not self._is_usable:
            raise self._lost()
        self._protocol.send_ping(b"")
        self._write()

    def close(self) -> None:
        """Close; messages sent before have arrived when it returns."""
        end = time.monotonic() + GOODBYE
        try:
            if self._is_usable:
                self._protocol.send_close()
                self._write()
            while not self._is_ended and (left := end - time.monotonic()) > 0:
                self.receive(left)
        except NoSimulatorError:
            pass
        finally:
            self._drop()

    @property
    def _is_usable(self) -> bool:
        """Whether neither side has closed the connection."""
        return not self._is_ended and self._protocol.state is State.OPEN

    @property
    def subprotocol(self) -> str | None:
        """The subprotocol that the simulator chose: None if it does not speak this version."""
        return self._protocol.subprotocol

    # -- the socket ---------------------------------------------------------------------------------------------

    def _connected(self) -> socket.socket:
        address = self._address
        try:
            tcp = socket.create_connection((address.host, address.port), self._timeout)
            if address.is_secure:
                tcp = ssl.create_default_context().wrap_socket(tcp, server_hostname=address.host)
        except ConnectionRefusedError:
            start = "start a simulator with 'autodrive', and use the link that 'autodrive' prints"
            raise NotListeningError(f"no simulator listens at {address}: {start}") from None
        except TimeoutError:
            raise NoSimulatorError(f"no answer from {address} within {self._timeout:g} s") from None
        except OSError as error:
            raise NoSimulatorError(f"cannot connect to {address}: {error.strerror or error}") from None
        tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        tcp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, KEPT)
        tcp.setblocking(False)
        return tcp

    def _shake_hands(self) -> None:
        protocol = self._protocol
        protocol.send_request(protocol.connect())
        self._write()
        end = time.monotonic() + self._timeout
        while protocol.state is State.CONNECTING and protocol.handshake_exc is None:
            if (left := end - time.monotonic()) <= 0:
                raise NoSimulatorError(f"no answer from {self._address} within {self._timeout:g} s")
            self._selector.select(left)
            self._read()
        error = protocol.handshake_exc
        if isinstance(error, InvalidStatus) and error.response.status_code == 403:
            raise AutodriveError(
                bytes(error.response.body or b"").decode(errors="replace") or "the simulator refused the connection"
            )
        if error is not None and isinstance(error.__cause__, EOFError):
            raise self._lost()
        if error is not None:
            raise AutodriveError(
                f"the server at {self._address}, path {self._address.path}, is not a simulator: {error}"
            )

    def _read(self) -> list[bytes]:
        """Received messages, without waiting."""
        if self._is_ended:
            raise self._lost()
        messages: list[bytes] = []
        while len(messages) < MANY:
            try:
                data = self._socket.recv(KEPT)
            except _NOT_NOW:
                break
            except OSError:
                data = b""
            if data:
                self._protocol.receive_data(data)
            else:
                self._is_ended = True
                self._protocol.receive_eof()
            messages += self._whole_messages()
            self._write()
            if self._is_ended:
                break
        if self._is_ended and not messages and self._is_open:
            raise self._lost()
        return messages

    def _whole_messages(self) -> list[bytes]:
        """Complete messages; a proxy may have split a message into fragments."""
        messages: list[bytes] = []
        for event in self._protocol.events_received():
            if isinstance(event, Frame) and event.opcode is Opcode.PONG:
                self.pongs += 1
            elif isinstance(event, Frame) and event.opcode in (Opcode.BINARY, Opcode.TEXT, Opcode.CONT):
                self._part += event.data
                if event.fin:
                    messages.append(self._part)
                    self._part = b""
        return messages

    def _write(self) -> None:
        """Write the pending data of the protocol; waits if the socket is not ready."""
        rest = memoryview(b"".join(self._protocol.data_to_send()))
        while rest and not self._is_ended:
            try:
                rest = rest[self._socket.send(rest) :]
            except _NOT_NOW:
                self._await_room()
            except OSError:
                self._is_ended = True

    def _await_room(self) -> None:
        self._selector.modify(self._socket, selectors.EVENT_WRITE)
        is_room = self._selector.select(self._timeout)
        self._selector.modify(self._socket, selectors.EVENT_READ)
        if not is_room:
            raise TimeoutError(f"the simulator at {self._address} accepted no message within {self._timeout:g} s")

    def _lost(self) -> NoSimulatorError:
        reason = self._protocol.close_rcvd.reason if self._protocol.close_rcvd else ""
        return NoSimulatorError(f"the connection to the simulator at {self._address} was lost. {reason}".rstrip())

    def _drop(self) -> None:
        self._is_ended = True
        self._selector.close()
        self._socket.close()
