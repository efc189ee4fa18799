"""The connection of one client to a simulator: connects and reconnects, sends messages, requests operations."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from contextlib import suppress

import msgspec
from msgspec.structs import replace

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.connect.client.client_socket import ClientSocket, NoSimulatorError, NotListeningError
from autodrive.connect.client.target import Target, described
from autodrive.connect.client.view import ClientView
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import (
    AddBox,
    CloseLoop,
    EditMap,
    EditTrack,
    Frame,
    GenerateTrack,
    InsertModule,
    LoadScenario,
    Pause,
    Redo,
    RemoveBox,
    RemoveTraffic,
    Resume,
    SetSensor,
    Undo,
    UseMap,
)
from autodrive.protocol.native import (
    PROTOCOL,
    ClientMessage,
    Error,
    Hello,
    Request,
    Response,
    ServerOperation,
    Subscribe,
)
from autodrive.protocol.own_files import ImportTrack

LOADING = 300.0
"""Time limit for loading a scenario, which may build its meshes first [s]."""
LOADED = (
    *(LoadScenario, AddBox, RemoveBox, SetSensor, RemoveTraffic),
    *(EditMap, UseMap, CloseLoop, InsertModule, EditTrack, GenerateTrack, ImportTrack),
    *(Undo, Redo),
)
"""Operations that compile a scenario."""
RETRY = 0.2
"""Time between two attempts to reconnect [s]."""
BACKLOG = 2**16
"""Amount that is received at once [bytes] from which on the simulator may have waited, and a newer Frame follows."""
CATCH_UP = 0.5
"""Longest wait for that Frame, which does not come while the simulation is paused [s]."""


class Connection:
    """Connects when it is created; see `Client` for the arguments. `view` is what the simulator has sent.

    `target()` says where to connect; it is asked again before each attempt. Waits while no simulator listens there.
    """

    def __init__(
        self, target: Callable[[], Target], name: str, subscription: Subscribe, timeout: float, patience: float
    ) -> None:
        self._target = target
        self.simulator = ""
        """What it is connected to; see `Client.simulator`."""
        self.name = name
        self.subscription = subscription
        self.timeout = timeout
        self.patience = patience
        self.view = ClientView()
        self.is_stepping = False
        """Whether this client paused the simulation."""
        self.text = ""
        """The text of the latest Response."""
        self.is_closed = False
        self._socket: ClientSocket | None = None
        self._requests = 0
        self._awaited = 0
        self._answer: Frame | Error | None = None
        self._is_read = True
        self._was_connected = False
        self._connected()

    def close(self) -> None:
        """Disconnect."""
        self.is_closed = True
        self._lose()

    def receive(self, timeout: float) -> int:
        """Receive messages as `_receive` does, but reconnect if the connection was lost."""
        try:
            return self._receive(timeout)
        except NoSimulatorError:
            self._connected()
            return 0

    def catch_up(self) -> None:
        """Process all messages that were received; if they were many, also the newer Frame that follows."""
        if self.receive(0.0) > BACKLOG and self.subscription.frame_rate != 0:
            self._await_fresh()
        self.raise_refusal()

    def raise_refusal(self) -> None:
        """Raise the first refusal since the last call."""
        if self.view.errors:
            error, *_ = self.view.errors
            self.view.errors.clear()
            hint = (
                ": sim.set_driving_mode(vehicle, is_autonomous=True) changes the mode" if error.code == "mode" else ""
            )
            raise CommandError(error.text + hint)

    def until(self, is_there: Callable[[], bool], timeout: float | None, awaited: str) -> None:
        """Receive until `is_there()`, at most for `timeout` [s]."""
        limit = self.timeout if timeout is None else timeout
        end = time.monotonic() + limit
        while not is_there():
            socket = self._socket
            if (left := end - time.monotonic()) <= 0:
                raise TimeoutError(f"no {awaited} came within {limit:g} s" + self._reason())
            self.receive(left)
            self.raise_refusal()
            if self._socket is not socket:
                end = time.monotonic() + limit

    def send(self, message: ClientMessage) -> None:
        """Send a message that has no answer."""
        self.catch_up()
        data = encode(message)
        try:
            self._connected().send(data)
        except NoSimulatorError:
            self._lose()
            self._connected().send(data)

    def subscribe(self, subscription: Subscribe) -> None:
        """Change the subscription."""
        self.subscription = subscription
        self.send(subscription)

    def begin_stepping(self) -> None:
        """Pause; the events until now belong to the first step."""
        self.request(Pause(), is_read=False)
        self.is_stepping = True

    def request(self, operation: ServerOperation, timeout: float | None = None, *, is_read: bool = True) -> Frame:
        """Request an operation; returns the Frame after it."""
        if self.is_stepping and self._socket is not None:
            self._receive(0.0)  # without reconnecting: another world must not be stepped instead of this one
        else:
            self.receive(0.0)
        self.raise_refusal()
        usual = LOADING if isinstance(operation, LOADED) else self.timeout
        limit = usual if timeout is None else timeout
        end = time.monotonic() + limit
        self._requests += 1
        self._awaited, self._answer, self._is_read = self._requests, None, is_read
        try:
            self._connected().send(encode(Request(self._awaited, operation)))
            while self._answer is None:
                if (left := end - time.monotonic()) <= 0:
                    raise TimeoutError(f"a {type(operation).__name__} was not answered within {limit:g} s")
                self._receive(left)
        except NoSimulatorError as error:
            self._lose()
            raise NoSimulatorError(f"{error} (during a {type(operation).__name__})") from None
        finally:
            answer, self._awaited, self._answer = self._answer, 0, None
        if isinstance(answer, Error):
            raise CommandError(answer.text)
        assert answer is not None
        if isinstance(operation, Pause | Resume) and self.view.status is not None:  # the next Status comes later
            self.view.status = replace(self.view.status, is_paused=isinstance(operation, Pause))
        return answer

    # -- the socket ---------------------------------------------------------------------------------------------

    def _await_fresh(self) -> None:
        """Wait for a Frame that was sent after a pong: messages received before it may be old."""
        socket = self._connected()
        pongs = socket.pongs
        with suppress(NoSimulatorError):  # reported by the next receive
            socket.ping()
        self.until(lambda: self._socket is not socket or socket.pongs > pongs, None, "pong")
        count, end = self.view.count, time.monotonic() + CATCH_UP
        while self.view.count == count and (left := end - time.monotonic()) > 0:
            self.receive(left)

    def _connect(self) -> None:
        """Connect, and wait for the Welcome."""
        target = self._target()
        self.address = target.address
        socket = ClientSocket(self.address, self.timeout)
        self.view = ClientView()
        self.is_stepping = False
        try:
            socket.send(encode(Hello(PROTOCOL, self.name)), encode(self.subscription))
            end = time.monotonic() + self.timeout
            while self.view.welcome is None:
                if (left := end - time.monotonic()) <= 0:
                    raise NoSimulatorError(f"no Welcome came from {self.address} within {self.timeout:g} s")
                for data in socket.receive(left):
                    self._take(data)
                    end = time.monotonic() + self.timeout  # a simulator that is starting says so until it is ready
                self._check_welcome(target)
        except NoSimulatorError as error:
            socket.close()
            if socket.subprotocol is None:  # a simulator that speaks another version closes the connection
                raise AutodriveError(
                    f"the simulator at {self.address} does not speak version {PROTOCOL} of the native protocol: "
                    f"install the same version of the simulator and of its client ({error})"
                ) from None
            raise
        except BaseException:
            socket.close()
            raise
        self._socket = socket
        self._was_connected = True
        assert self.view.welcome is not None
        self.simulator = f"'{self.view.welcome.title}' at {self.address}, {described(self.view.welcome.run)}"

    def _check_welcome(self, target: Target) -> None:
        for error in self.view.errors:
            raise AutodriveError(error.text)
        welcome = self.view.welcome
        if welcome is not None and welcome.protocol != PROTOCOL:
            raise AutodriveError(
                f"the simulator at {self.address} ({welcome.version}) speaks version {welcome.protocol} of the "
                f"native protocol, this client version {PROTOCOL}: install the same version of the simulator and of "
                "its client"
            )
        if welcome is not None and (refusal := target.refusal(welcome.run)):
            raise AutodriveError(refusal)

    def _connected(self) -> ClientSocket:
        """The open socket; connects, and waits until a simulator listens."""
        if self.is_closed:
            raise AutodriveError("this Client was closed: make a new one")
        end = time.monotonic() + self.patience
        is_told = self._was_connected
        while self._socket is None:
            try:
                self._connect()
            except NoSimulatorError as error:
                is_possible = self._was_connected or isinstance(error, NotListeningError)
                if not is_possible or time.monotonic() >= end:
                    waited = f"; waited {self.patience:g} s" if is_possible and self.patience else ""
                    raise NoSimulatorError(f"{error}{waited}") from None
                if not is_told:
                    is_told = True
                    print(f"autodrive: waiting up to {self.patience:g} s: {error}", file=sys.stderr, flush=True)
                time.sleep(RETRY)
        return self._socket

    def _lose(self) -> None:
        socket, self._socket = self._socket, None
        if socket is not None:
            socket.close()

    def _receive(self, timeout: float) -> int:
        """Process received messages, waiting at most `timeout` [s]; returns their size [bytes]."""
        socket = self._connected()
        try:
            messages = socket.receive(timeout)
        except NoSimulatorError:
            self._lose()
            raise
        for data in messages:
            self._take(data)
        return sum(map(len, messages))

    def _take(self, data: bytes) -> None:
        try:
            message = decode_server(data)
        except msgspec.ValidationError as error:
            if str(error).endswith("`$.type`"):
                return  # a message of a newer simulator
            raise AutodriveError(f"a message of the simulator at {self.address} was not understood: {error}") from None
        match message:
            case Response(id=id, frame=frame, text=text):
                self.view.take(frame)
                if id == self._awaited:
                    self.text = text
                    self._answer = self.view.read() if self._is_read else frame
            case Error(id=int(id)):
                if id == self._awaited:
                    self._answer = message
            case _:
                self.view.take(message)

    def _reason(self) -> str:
        status = self.view.status
        if status is None:
            return ""
        reasons = [status.note, (status.cameras_error or status.cameras_note) if self.subscription.picture_rate else ""]
        if status.is_paused:
            reasons.append("the simulation is paused: sim.resume() lets it run, sim.step() runs one tick")
        return "".join(f"; {reason}" for reason in reasons if reason)
