"""The conversation of one client with a simulator: connecting, also again, and requests with their answers."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress

import msgspec
from msgspec.structs import replace

from autodrive.client.view import View
from autodrive.client.wire import Address, NoSimulatorError, Wire
from autodrive.errors import AutodriveError, CommandError
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import Frame, Pause, Resume
from autodrive.protocol.native import PROTOCOL, Ask, ClientMessage, Done, Fault, Hello, Please, Subscribe

RETRY = 0.2
"""Between two attempts to reach a simulator that was lost [s]."""
BACKLOG = 2**16
"""Where so much had come since the last look [bytes], the simulator may have waited: a newer Frame follows at once."""
CATCH_UP = 0.5
"""That Frame is waited for so long at most: while paused there is none [s]."""


class Conversation:
    """Begins when it is made; see `Client` for what it is given. `view` is what the simulator has told."""

    def __init__(self, address: Address, name: str, subscription: Subscribe, timeout: float, patience: float) -> None:
        self.address = address
        self.name = name
        self.subscription = subscription
        self.timeout = timeout
        self.patience = patience
        self.view = View()
        self.is_stepping = False
        """Whether this client paused the simulation."""
        self.is_closed = False
        self._wire: Wire | None = None
        self._requests = 0
        self._awaited = 0
        self._answer: Frame | Fault | None = None
        self._is_read = True
        self._connect()

    def close(self) -> None:
        """Say goodbye."""
        self.is_closed = True
        self._lose()

    def look(self, timeout: float) -> int:
        """As `_pull`, but if the simulator was lost, waits for the next."""
        try:
            return self._pull(timeout)
        except NoSimulatorError:
            self._connected()
            return 0

    def catch_up(self) -> None:
        """Take all that has come; if that was much, also the fresh Frame that follows it."""
        if self.look(0.0) > BACKLOG and self.subscription.frame_rate != 0:
            self._await_fresh()
        self.complain()

    def complain(self) -> None:
        """Raise what the simulator refused since the last call; the first counts."""
        if self.view.faults:
            fault, *_ = self.view.faults
            self.view.faults.clear()
            hint = ": sim.set_driving_mode(vehicle, is_autonomous=True) makes it so" if fault.code == "mode" else ""
            raise CommandError(fault.text + hint)

    def until(self, is_there: Callable[[], bool], timeout: float | None, what: str) -> None:
        """Look until it is there, at most so long [s]."""
        limit = self.timeout if timeout is None else timeout
        end = time.monotonic() + limit
        while not is_there():
            wire = self._wire
            if (left := end - time.monotonic()) <= 0:
                raise TimeoutError(f"no {what} came within {limit:g} s" + self._reason())
            self.look(left)
            self.complain()
            if self._wire is not wire:
                end = time.monotonic() + limit

    def tell(self, message: ClientMessage) -> None:
        """Send what nobody answers."""
        self.catch_up()
        data = encode(message)
        try:
            self._connected().send(data)
        except NoSimulatorError:
            self._lose()
            self._connected().send(data)

    def subscribe(self, subscription: Subscribe) -> None:
        """Want something else from now on."""
        self.subscription = subscription
        self.tell(subscription)

    def begin_stepping(self) -> None:
        """Pause; the events until now are those of the first step."""
        self.ask(Pause(), is_read=False)
        self.is_stepping = True

    def ask(self, request: Ask, timeout: float | None = None, *, is_read: bool = True) -> Frame:
        """The Frame after a request."""
        if self.is_stepping and self._wire is not None:
            self._pull(0.0)  # another world is not stepped as if it were this one
        else:
            self.look(0.0)
        self.complain()
        limit = self.timeout if timeout is None else timeout
        end = time.monotonic() + limit
        self._requests += 1
        self._awaited, self._answer, self._is_read = self._requests, None, is_read
        try:
            self._connected().send(encode(Please(self._awaited, request)))
            while self._answer is None:
                if (left := end - time.monotonic()) <= 0:
                    raise TimeoutError(f"a {type(request).__name__} was not answered within {limit:g} s")
                self._pull(left)
        except NoSimulatorError as error:
            self._lose()
            raise NoSimulatorError(f"{error} (while a {type(request).__name__} was under way)") from None
        finally:
            answer, self._awaited, self._answer = self._answer, 0, None
        if isinstance(answer, Fault):
            raise CommandError(answer.text)
        assert answer is not None
        if isinstance(request, Pause | Resume) and self.view.status is not None:  # the next Status is on its way
            self.view.status = replace(self.view.status, is_paused=isinstance(request, Pause))
        return answer

    # -- the wire -------------------------------------------------------------------------------------------------

    def _await_fresh(self) -> None:
        """What was on the way is old; what the simulator sends after a pong was chosen then."""
        wire = self._connected()
        pongs = wire.pongs
        with suppress(NoSimulatorError):  # the next look tells
            wire.ping()
        self.until(lambda: self._wire is not wire or wire.pongs > pongs, None, "pong")
        count, end = self.view.count, time.monotonic() + CATCH_UP
        while self.view.count == count and (left := end - time.monotonic()) > 0:
            self.look(left)

    def _connect(self) -> None:
        """Begin a conversation; until the Welcome."""
        wire = Wire(self.address, self.timeout)
        self.view = View()
        self.is_stepping = False
        try:
            wire.send(encode(Hello(PROTOCOL, self.name)), encode(self.subscription))
            end = time.monotonic() + self.timeout
            while self.view.welcome is None:
                if (left := end - time.monotonic()) <= 0:
                    raise NoSimulatorError(f"no Welcome came from {self.address} within {self.timeout:g} s")
                for data in wire.receive(left):
                    self._take(data)
                self._check_welcome()
        except BaseException:
            wire.close()
            raise
        self._wire = wire

    def _check_welcome(self) -> None:
        for fault in self.view.faults:
            both = f". This client speaks {PROTOCOL}: use the same version of autodrive on both sides"
            raise AutodriveError(fault.text + (both if fault.code == "version" else ""))
        welcome = self.view.welcome
        if welcome is not None and welcome.protocol != PROTOCOL:
            raise AutodriveError(
                f"the simulator at {self.address} ({welcome.version}) speaks version {welcome.protocol} of the "
                f"protocol, this client {PROTOCOL}: use the same version of autodrive on both sides"
            )

    def _connected(self) -> Wire:
        """The connection; one that was lost is made anew, as soon as there is a simulator again."""
        if self.is_closed:
            raise AutodriveError("this Client was closed")
        end = time.monotonic() + self.patience
        while self._wire is None:
            try:
                self._connect()
            except NoSimulatorError as error:
                if time.monotonic() >= end:
                    raise NoSimulatorError(f"{error}; it was waited for {self.patience:g} s") from None
                time.sleep(RETRY)
        return self._wire

    def _lose(self) -> None:
        wire, self._wire = self._wire, None
        if wire is not None:
            wire.close()

    def _pull(self, timeout: float) -> int:
        """Take what has come, and wait for it at most so long [s]; how much it was [bytes]."""
        wire = self._connected()
        try:
            messages = wire.receive(timeout)
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
                return  # a kind of message that a newer simulator knows
            raise AutodriveError(f"a message of the simulator at {self.address} was not understood: {error}") from None
        match message:
            case Done(id=id, frame=frame):
                self.view.take(frame)
                if id == self._awaited:
                    self._answer = self.view.taken() if self._is_read else frame
            case Fault(id=int(id)):
                if id == self._awaited:
                    self._answer = message
            case _:
                self.view.take(message)

    def _reason(self) -> str:
        status = self.view.status
        if status is None:
            return ""
        reasons = [status.note, status.cameras_fault if self.subscription.picture_rate else ""]
        if status.is_paused:
            reasons.append("the simulation is paused: sim.resume() lets it run, sim.step() runs one tick")
        return "".join(f"; {reason}" for reason in reasons if reason)
