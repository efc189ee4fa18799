"""One connection to a devkit script, from its first packet to its last."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from websockets.exceptions import WebSocketException

from autodrive.bridge.engineio import (
    FAREWELL,
    Acknowledgement,
    Conversation,
    ConversationEnd,
    Dialect,
    Event,
    PacketError,
    event_packet,
)
from autodrive.bridge.ledger import Ledger
from autodrive.bridge.turns import Turns
from autodrive.protocol import devkit
from autodrive.protocol.messages import Command, Reset

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

    from autodrive.protocol.messages import Frame, Request

log = logging.getLogger(__name__)

EVENT = "Bridge"
"""The one event name of the devkits, in both directions."""

SHARES = (1.0, 0.7, 0.45, 0.25, 0.12)
"""Of the usual quality of pictures, tried in turn while a message is too long. From quality 75 they make a JPEG of a
road by day 1, 0.66, 0.5, 0.36 and 0.27 times as long (measured)."""

_CAN_CONFIRM_AT_ONCE = hasattr(socket, "TCP_QUICKACK")
"""Linux. Elsewhere the server is not asked to acknowledge: its system sends a second small packet, the acknowledgement
after the command, only when ours has confirmed the first, and ours would wait 40 to 200 ms for that."""


class Driven(Protocol):
    """What is needed of a Simulation; any thread may call it."""

    @property
    def frame(self) -> Frame:
        """The latest Frame, whole."""
        ...

    def submit(self, vehicle: str, command: Command) -> None:
        """Leave a command for the next tick; the latest wins."""
        ...

    def request(self, request: Request) -> object:
        """Ask for something to be done before the next tick."""
        ...


class Session:
    """Tells the script the state of `simulation` and does what it says.

    `profile` None: recognise the era of the script. `traffic_lights` are the states by number that scripts gave; they
    are told back. What happens is counted in `ledger`.
    """

    def __init__(
        self,
        socket: ClientConnection,
        simulation: Driven,
        ledger: Ledger,
        *,
        profile: devkit.Profile | None,
        traffic_lights: dict[int, int],
        images: Callable[[Frame, float], devkit.Images] | None,
    ) -> None:
        self.turns = Turns()
        self.awaits_frame = False
        """Whether `wake` is to be set when there is a new Frame."""
        self.wake = asyncio.Event()
        self.conversation = Conversation(time.monotonic())
        self._socket = socket
        self._simulation = simulation
        self._ledger = ledger
        self._profile = profile
        self._is_profile_given = profile is not None
        self._traffic_lights = traffic_lights
        self._images = images
        self._share = 0
        """Which of `SHARES` the latest pictures had."""
        self._commands: dict[str, Command] = {}
        self._held_resets: dict[str, bool] = {}
        self._was_open = False

    async def listen(self) -> None:
        """Take what the server sends, until it sends no more. Raises `ConversationEnd` or what the socket raises."""
        tcp = self._socket.transport.get_extra_info("socket")
        async for packet in self._socket:
            if _CAN_CONFIRM_AT_ONCE:
                tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)  # the system forgets it after each use
            try:
                self._take(packet)
            except PacketError as fault:
                self._ledger.counters.bad_packets += 1
                self._ledger.complain("packet", str(fault))
            self.wake.set()
        raise ConversationEnd("the server closed the connection")

    async def speak(self) -> None:
        """Send what is due, until the connection ends. Raises `ConversationEnd` or what the socket raises."""
        while True:
            self.wake.clear()
            now = time.monotonic()
            self.conversation.pass_time(now)
            await self._empty_outbox()
            is_open = self.conversation.is_open
            if is_open and not self._was_open:
                self._note_opening()
            # before the look at the latest Frame, so that none is missed
            self.awaits_frame = is_open and self.turns.awaits_frame
            frame = self._simulation.frame
            if is_open and self.turns.is_ours(frame, now):
                await self._tell(frame, now)
                continue
            deadline = min(self.conversation.deadline, self.turns.deadline if is_open else math.inf)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(deadline - now, 0.0) if math.isfinite(deadline) else None):
                    await self.wake.wait()

    async def say_goodbye(self) -> None:
        """Tell the server that we leave, if it listens."""
        with contextlib.suppress(TimeoutError, WebSocketException):
            async with asyncio.timeout(0.2):
                for packet in FAREWELL:
                    await self._socket.send(packet)
        await self._socket.close()

    # -- what comes ---------------------------------------------------------------------------------------------

    def _take(self, packet: str | bytes) -> None:
        if isinstance(packet, bytes):
            raise PacketError(f"{len(packet)} bytes of binary data")
        match self.conversation.receive(packet, time.monotonic()):
            case Event() as event:
                if round_trip := self.turns.answered(time.monotonic()):  # an answer even if there is nothing in it
                    self._ledger.add_round_trip(round_trip)
                self._obey(_commands_in(event))
            case Acknowledgement(number=number):
                self.turns.acknowledged(number)
            case None:
                pass

    def _obey(self, data: dict[str, Any]) -> None:
        self._ledger.counters.commands_received += 1
        self._recognise(data)
        vehicles = self._simulation.frame.vehicles
        previous = {name: self._commands.get(name, Command()) for name in vehicles}
        orders = devkit.read_orders(data, self._profile or devkit.PROFILES["2025"], previous)
        self._traffic_lights.update(orders.traffic_lights)
        for vehicle, command in orders.commands.items():
            if vehicles[vehicle].is_autonomous:
                self._commands[vehicle] = command
                self._simulation.submit(vehicle, command)
        wishes = [name for name, is_held in orders.resets.items() if is_held and not self._held_resets.get(name)]
        self._held_resets |= orders.resets
        if any(vehicles[name].is_autonomous for name in wishes):
            self._simulation.request(Reset())
        for fault in orders.refused:
            self._ledger.counters.refused_values += 1
            self._ledger.complain("value", f"refused {fault}")

    def _recognise(self, data: dict[str, Any]) -> None:
        """Set the profile at the first sign of it. A 2023 script may still turn out to be of 2025, but no other."""
        found = None if self._is_profile_given else devkit.recognise(data)
        if found and (self._profile is None or (self._profile.name, found.name) == ("2023", "2025")):
            log.info("devkit bridge: the script speaks as those of %s do", found.name)
            self._profile = found
            self._ledger.counters.profile = found.name

    def _note_opening(self) -> None:
        self._was_open = True
        counters, dialect = self._ledger.counters, self.conversation.dialect
        counters.dialect = dialect
        counters.profile = self._profile.name if self._profile else None
        counters.reconnects += counters.connections > 0
        counters.connections += 1
        log.info("devkit bridge: connected to a script (%s)", dialect)

    # -- what goes ----------------------------------------------------------------------------------------------

    async def _empty_outbox(self) -> None:
        packets, self.conversation.outbox = self.conversation.outbox, []
        for packet in packets:
            await self._socket.send(packet)

    async def _tell(self, frame: Frame, now: float) -> None:
        may_ask = _CAN_CONFIRM_AT_ONCE and self.conversation.dialect is not Dialect.RAW
        number = self.turns.begin(frame, now, may_ask=may_ask)
        counters = self._ledger.counters
        counters.resends += self.turns.is_repeat
        if self.turns.silences:
            self._ledger.complain(
                "silence", "the script is silent and gets the state again (if it raises: name its era)"
            )
        text = self._telemetry(frame, number)
        if text is None:
            counters.oversized += 1
            self._ledger.complain("size", f"telemetry is longer than {self.conversation.max_payload} and is not sent")
            return
        await self._socket.send(text)
        counters.telemetry_sent += 1

    def _telemetry(self, frame: Frame, number: int | None) -> str | None:
        """The packet, with the best pictures that it has room for; None if even without any it is too long."""
        limit = self.conversation.max_payload
        if self._images:
            for share in range(max(self._share - 1, 0), len(SHARES)):  # one better than last: there may be room again
                packet = event_packet(EVENT, self._data(frame, self._images(frame, SHARES[share])), number)
                if len(packet) < limit:
                    self._note_share(share)
                    return packet
            self._note_share(len(SHARES))
        packet = event_packet(EVENT, self._data(frame, None), number)
        return packet if len(packet) < limit else None

    def _note_share(self, number: int) -> None:
        if number > self._share:
            worse = f"sent at {SHARES[number]:.0%} of their quality" if number < len(SHARES) else "left out"
            limit = self.conversation.max_payload
            self._ledger.complain("pictures", f"telemetry is longer than {limit}; pictures are {worse}")
        self._share = number

    def _data(self, frame: Frame, images: devkit.Images | None) -> dict[str, str]:
        """The state for the era of the script; for all eras while that is not known, or was taken for a wrong one."""
        is_doubtful = not self._is_profile_given and self.turns.silences > 1
        if self._profile is None or is_doubtful:
            return devkit.introduction(frame, self.turns.silences, images=images)
        return devkit.telemetry(frame, self._profile, traffic_lights=self._traffic_lights, images=images)


def _commands_in(event: Event) -> dict[str, Any]:
    match event:
        case Event(name=name, arguments=[dict() as data, *_]) if name == EVENT:
            return data
    raise PacketError(f"an event '{event.name[:40]}' without commands; they come as '{EVENT}' with a dictionary")
