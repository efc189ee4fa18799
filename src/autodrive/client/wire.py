"""A WebSocket to the simulator over a plain socket: no thread, no loop, and nothing waits without an end."""

from __future__ import annotations

import selectors
import socket
import ssl
import time
from dataclasses import dataclass
from urllib.parse import parse_qs, urlencode, urlsplit

from websockets.client import ClientProtocol
from websockets.exceptions import InvalidStatus
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

from autodrive.errors import AutodriveError
from autodrive.protocol.native import SUBPROTOCOL
from autodrive.protocol.ports import PORT

LARGEST = 2**26
"""No message is longer [bytes]."""
KEPT = 2**18
"""What the system keeps for a script that does not read [bytes]; the simulator sends no more until it does."""
MANY = 1000
"""Messages that are read at once; what comes faster than it is read would never end."""
GOODBYE = 0.5
"""So long the other side may take to end a conversation [s]."""

_NOT_NOW = (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError)


class NoSimulatorError(AutodriveError, ConnectionError):
    """No simulator could be reached, or the connection to it was lost."""


@dataclass(frozen=True)
class Address:
    """Where a simulator is, of 'host:port' or of the link that it prints. `path` is that of its page."""

    host: str
    port: int
    path: str = "/"
    token: str | None = None
    is_secure: bool = False

    @staticmethod
    def of(text: str, token: str | None = None) -> Address:
        """'127.0.0.1:8730', 'lab-pc', 'http://host:port/?token=...', also of a proxy ('https://hub/user/proxy/8730/')."""
        has_scheme = "://" in text
        try:
            parts = urlsplit(text if has_scheme else f"http://{text}")
            host, port = parts.hostname, parts.port
        except ValueError:
            host = port = None
            parts = urlsplit("")
        if not host or parts.scheme not in {"http", "https", "ws", "wss"}:
            raise AutodriveError(
                f"'{text}' is no address of a simulator: '127.0.0.1:{PORT}' is one, or the link that it prints"
            )
        is_secure = parts.scheme in {"https", "wss"}
        usual = (443 if is_secure else 80) if has_scheme else PORT
        path = parts.path.removesuffix("ws") or "/"
        given = parse_qs(parts.query).get("token", [None])[0]
        return Address(host, port or usual, path if path.endswith("/") else path + "/", token or given, is_secure)

    @property
    def uri(self) -> str:
        """Of the WebSocket."""
        query = f"?{urlencode({'token': self.token})}" if self.token else ""
        return f"{'wss' if self.is_secure else 'ws'}://{self}{self.path}ws{query}"

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


class Wire:
    """A WebSocket, connected when it is made. Raises `NoSimulatorError` where nobody is, or when the other side left.

    An `AutodriveError` that is none says that the simulator does not let this client in.
    """

    def __init__(self, address: Address, timeout: float) -> None:
        self._address = address
        self._timeout = timeout
        self._protocol = ClientProtocol(parse_uri(address.uri), subprotocols=[SUBPROTOCOL], max_size=LARGEST)  # type: ignore[list-item]
        self._part = b""  # of a message that came in fragments
        self._is_open = False
        self._is_ended = False
        self.pongs = 0
        """Answers to pings that came."""
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
        """Send them now, together."""
        if not self._is_talking:
            raise self._lost()
        for message in messages:
            self._protocol.send_binary(message)
        self._write()

    def receive(self, timeout: float) -> list[bytes]:
        """Messages that have come; waits at most `timeout` [s] for the first, none if there is none."""
        messages = self._read()
        if messages or timeout <= 0:
            return messages
        end = time.monotonic() + timeout
        while not messages and (left := end - time.monotonic()) > 0:
            self._selector.select(left)
            messages = self._read()
        return messages

    def ping(self) -> None:
        """Ask for a pong, which follows all that was sent here before."""
        if not self._is_talking:
            raise self._lost()
        self._protocol.send_ping(b"")
        self._write()

    def close(self) -> None:
        """Say goodbye; what was sent before has arrived then."""
        end = time.monotonic() + GOODBYE
        try:
            if self._is_talking:
                self._protocol.send_close()
                self._write()
            while not self._is_ended and (left := end - time.monotonic()) > 0:
                self.receive(left)
        except NoSimulatorError:
            pass
        finally:
            self._drop()

    @property
    def _is_talking(self) -> bool:
        """Whether neither side has ended the conversation."""
        return not self._is_ended and self._protocol.state is State.OPEN

    # -- the socket ---------------------------------------------------------------------------------------------

    def _connected(self) -> socket.socket:
        address = self._address
        try:
            tcp = socket.create_connection((address.host, address.port), self._timeout)
            if address.is_secure:
                tcp = ssl.create_default_context().wrap_socket(tcp, server_hostname=address.host)
        except ConnectionRefusedError:
            start = "start one with 'autodrive', and use the link that it prints"
            raise NoSimulatorError(f"no simulator listens at {address}: {start}") from None
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
            raise AutodriveError(bytes(error.response.body or b"").decode(errors="replace") or "the simulator refused")
        if error is not None and isinstance(error.__cause__, EOFError):
            raise self._lost()
        if error is not None:
            raise AutodriveError(
                f"what listens at {self._address}, path {self._address.path}, is no simulator: {error}"
            )

    def _read(self) -> list[bytes]:
        """What has come, without waiting."""
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
        """Of the fragments that have come; a proxy may have cut a message."""
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
        """What the protocol wants to send; waits if the system does not take it."""
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
            raise TimeoutError(f"the simulator at {self._address} took no message within {self._timeout:g} s")

    def _lost(self) -> NoSimulatorError:
        reason = self._protocol.close_rcvd.reason if self._protocol.close_rcvd else ""
        return NoSimulatorError(f"the connection to the simulator at {self._address} was lost. {reason}".rstrip())

    def _drop(self) -> None:
        self._is_ended = True
        self._selector.close()
        self._socket.close()
