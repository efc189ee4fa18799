"""One connection to a devkit script: sends telemetry, receives commands."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from websockets.exceptions import WebSocketException

from autodrive.base.errors import AutodriveError
from autodrive.connect.bridge.detection import Detection
from autodrive.connect.bridge.engineio import (
    CLOSE_PACKETS,
    Acknowledgement,
    Dialect,
    EngineIoConnection,
    Event,
    PacketError,
    ServerClosed,
    event_packet,
    padded,
)
from autodrive.connect.bridge.flow_control import RESEND_DELAY, FlowControl
from autodrive.connect.bridge.metrics import Metrics
from autodrive.connect.bridge.wanted import Wanted
from autodrive.protocol import devkit
from autodrive.protocol.devkit_profile import PROFILES
from autodrive.protocol.messages import Command

if TYPE_CHECKING:
    from websockets.asyncio.client import ClientConnection

    from autodrive.protocol.messages import Frame
    from autodrive.world.simulation.control import Control

log = logging.getLogger(__name__)

EVENT = "Bridge"
"""Event name of the devkits, in both directions."""

QUALITY_FACTORS = (1.0, 0.7, 0.45, 0.25, 0.12)
"""Factors of the image quality, tried in turn while a message is too long. At quality 75 the relative size of an
image of a road by day becomes 1, 0.66, 0.5, 0.36 and 0.27 (measured)."""

CLOSE_TIMEOUT = 0.2
"""Time to send the close packets [s]."""

IMAGE_WAIT = 2.0
"""The first telemetry waits for an image of each camera, at most for this time [s]."""

_CAN_ACK_AT_ONCE = hasattr(socket, "TCP_QUICKACK")
"""True on Linux. Other systems request no acknowledgements: the server sends them in a second small packet after the
command, which Nagle's algorithm and delayed TCP acknowledgements hold back for 40 to 200 ms."""


class Session:
    """Sends the state of `simulation` to the script and applies its commands.

    `detection` holds the devkit generation of the script. `traffic_lights` holds the states that scripts have set, by
    number; telemetry reports them. `clock` gives monotonic time [s]; None: the time of the event loop.
    `on_telemetry` is called after each telemetry message. `resend_delay` [s]: see `FlowControl`.
    """

    def __init__(
        self,
        socket: ClientConnection,
        simulation: Control,
        metrics: Metrics,
        *,
        detection: Detection,
        traffic_lights: dict[int, int],
        images: Callable[[Frame, float], devkit.Images] | None = None,
        image_sizes: Callable[[], devkit.ImageSizes] | None = None,
        clock: Callable[[], float] | None = None,
        on_telemetry: Callable[[], None] = lambda: None,
        resend_delay: float = RESEND_DELAY,
    ) -> None:
        self._clock = clock or asyncio.get_running_loop().time
        self._resend_delay = resend_delay
        self.flow_control = FlowControl(resend_delay)
        self.awaits_frame = False
        """Whether a new Frame must set `wake`."""
        self.wake = asyncio.Event()
        self.engineio = EngineIoConnection(self._clock(), detection.settings.handshake)
        self._socket = socket
        self._simulation = simulation
        self._metrics = metrics
        self._detection = detection
        self._traffic_lights = traffic_lights
        self._images = images
        self._image_sizes = image_sizes or dict
        self._on_telemetry = on_telemetry
        self._size = 0
        """Length of the longest message to a raw server [characters]."""
        self._quality = 0
        """Index in `QUALITY_FACTORS` of the latest images."""
        self._commands: dict[str, Command] = {}
        self._wanted = Wanted()
        self._dialect: Dialect | None = None
        """Dialect of the telemetry that is sent; None before it is sent."""
        self._waits_until: float | None = None
        """When the first telemetry is sent without images [s]; None: it need not wait."""

    async def receive_loop(self) -> None:
        """Process packets until the connection ends. Raises `ConnectionEnd` or an error of the socket."""
        tcp = self._socket.transport.get_extra_info("socket")
        async for packet in self._socket:
            if _CAN_ACK_AT_ONCE:
                tcp.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)  # Linux resets the option after each use
            try:
                self.process(packet)
            except PacketError as error:
                self._metrics.counters.bad_packets += 1
                self._metrics.warn("packet", str(error))
            self.wake.set()
        raise ServerClosed("the server closed the connection")

    async def send_loop(self) -> None:
        """Send packets until the connection ends. Raises `ConnectionEnd` or an error of the socket."""
        while True:
            self.wake.clear()
            now = self._clock()
            self.engineio.check_timers(now)
            await self._empty_outbox()
            is_open = self.engineio.is_open
            if is_open and self.engineio.dialect is not self._dialect:
                self._note_opening()
            # set before the latest Frame is read, so that none is missed
            self.awaits_frame = is_open and (self.flow_control.awaits_frame or self._waits_until is not None)
            frame = self._simulation.frame
            self._look_for_images(frame, now)
            if is_open and self._waits_until is None and self.flow_control.should_send(frame, now):
                await self._send_telemetry(frame, now)
                continue
            due = self.flow_control.deadline if self._waits_until is None else self._waits_until
            deadline = min(self.engineio.deadline, due if is_open else math.inf)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(deadline - now, 0.0) if math.isfinite(deadline) else None):
                    await self.wake.wait()

    def renew_commands(self) -> None:
        """Let the script's last command to each vehicle go on; may be called from any thread."""
        for vehicle, command in list(self._commands.items()):
            self._simulation.renew(vehicle, command)

    async def close(self) -> None:
        """Send the close packets if the server still reads and is not raw, and close the socket."""
        packets = () if self.engineio.dialect is Dialect.RAW else CLOSE_PACKETS  # a raw server parses all as events
        with contextlib.suppress(TimeoutError, WebSocketException):
            async with asyncio.timeout(CLOSE_TIMEOUT):
                for packet in packets:
                    await self._socket.send(packet)
        await self._socket.close()

    # -- receive ------------------------------------------------------------------------------------------------

    def process(self, packet: str | bytes) -> None:
        """Use a packet of the script. Raises `PacketError`, and `ConnectionEnd` if the script ends the connection."""
        if isinstance(packet, bytes):
            raise PacketError(f"{len(packet)} bytes of binary data")
        match self.engineio.receive(packet, self._clock()):
            case Event() as event:
                if round_trip := self.flow_control.command_received(self._clock()):  # an empty command counts, too
                    self._metrics.add_round_trip(round_trip)
                self._apply(_commands_in(event))
            case Acknowledgement(number=number):
                self.flow_control.ack_received(number)
            case None:
                pass

    def _apply(self, data: dict[str, Any]) -> None:
        self._metrics.counters.commands_received += 1
        if self._detection.observe(data):
            self._note_detection()
        vehicles = {
            name: vehicle for name, vehicle in self._simulation.frame.vehicles.items() if not vehicle.is_traffic
        }
        previous = {name: self._commands.get(name, Command()) for name in vehicles}
        message = devkit.read_commands(data, self._detection.profile or PROFILES["2025"], previous)
        self._traffic_lights.update(message.traffic_lights)
        autonomous = {name for name, vehicle in vehicles.items() if vehicle.is_autonomous}
        for vehicle, command in message.commands.items():
            if vehicle in autonomous:
                self._commands[vehicle] = command
                self._simulation.submit(vehicle, command)
        self._wanted.add(message, autonomous)
        for operation in self._wanted.operations(self._simulation.frame):
            try:
                self._simulation.request(operation)
            except AutodriveError as error:
                self._metrics.warn("operation", f"refused: {error}")
        self._metrics.note_ignored(message.ignored)
        for error in message.refused:
            self._metrics.counters.refused_values += 1
            self._metrics.warn("value", f"refused {error}")

    def _note_detection(self) -> None:
        counters, detection = self._metrics.counters, self._detection
        counters.profile = detection.profile and detection.profile.name
        counters.devkit, counters.note = str(detection), detection.note
        log.info("devkit bridge: %s", detection)
        if detection.note:
            log.info("devkit bridge: %s", detection.note)

    def _note_opening(self) -> None:
        counters, dialect = self._metrics.counters, self.engineio.dialect
        is_first = self._dialect is None
        counters.dialect = self._dialect = dialect
        if is_first:
            counters.reconnects += counters.connections > 0
            counters.connections += 1
            self._waits_until = self._clock() + IMAGE_WAIT if self._images else None
        elif dialect is Dialect.ENGINE_IO_4:  # such a server has not read what it was sent before
            self.flow_control = FlowControl(self._resend_delay)
        self._detection.begin(dialect)
        profile = self._detection.profile
        counters.profile, counters.devkit, counters.note = profile and profile.name, str(self._detection), ""
        log.info("devkit bridge: connected to a script (%s)", dialect)

    def _look_for_images(self, frame: Frame, now: float) -> None:
        """End the wait of the first telemetry when each camera has an image, or when it was long enough."""
        if self._waits_until is not None and (now >= self._waits_until or self._has_images(frame)):
            self._waits_until = None

    def _has_images(self, frame: Frame) -> bool:
        cameras = ((vehicle, camera) for vehicle, camera in self._image_sizes() if vehicle in frame.vehicles)
        return all(camera in frame.vehicles[vehicle].cameras for vehicle, camera in cameras)

    # -- send ---------------------------------------------------------------------------------------------------

    async def _empty_outbox(self) -> None:
        packets, self.engineio.outbox = self.engineio.outbox, []
        for packet in packets:
            await self._socket.send(packet)

    async def _send_telemetry(self, frame: Frame, now: float) -> None:
        may_request_ack = _CAN_ACK_AT_ONCE and self.engineio.acknowledges
        number = self.flow_control.begin_send(frame, now, may_request_ack=may_request_ack)
        counters = self._metrics.counters
        counters.resends += self.flow_control.is_resend
        if self.flow_control.resends:
            self._metrics.warn(
                "silence",
                "the script sends no commands; telemetry is resent, also with scans in another format (if the script "
                f"raises an exception: choose its devkit with --devkit-profile, one of {', '.join(PROFILES)})",
            )
        text = self._telemetry_packet(frame, number)
        if text is None:
            counters.oversized += 1
            limit = self.engineio.max_payload
            self._metrics.warn("size", f"telemetry exceeds the limit of {limit} characters and is not sent")
            return
        if self.engineio.dialect is Dialect.RAW:
            text = self._padded(text, frame)
        await self._socket.send(text)
        self._on_telemetry()
        counters.telemetry_sent += 1

    def _telemetry_packet(self, frame: Frame, number: int | None) -> str | None:
        """The packet with images in the best quality that fits; None if it is too long even without images."""
        limit = self.engineio.max_payload
        if self._images:
            # start one step better than the last message: there may be room again
            for quality in range(max(self._quality - 1, 0), len(QUALITY_FACTORS)):
                packet = event_packet(EVENT, self._data(frame, self._images(frame, QUALITY_FACTORS[quality])), number)
                if len(packet) < limit:
                    self._note_quality(quality)
                    return packet
            self._note_quality(len(QUALITY_FACTORS))
        packet = event_packet(EVENT, self._data(frame, None), number)
        return packet if len(packet) < limit else None

    def _padded(self, packet: str, frame: Frame) -> str:
        """The packet for a raw server: none is shorter than an earlier one, the first is as long as any expected.

        The published C++ devkit reads a message up to the end of what its receive buffer contains, so that the rest of
        a longer message corrupts a shorter one.
        """
        longest = devkit.expected_size(frame, self._image_sizes())
        expected = self._size or min(longest, self.engineio.max_payload - 4)
        self._size = max(expected, len(packet))
        return padded(packet, self._size)

    def _note_quality(self, number: int) -> None:
        if number > self._quality:
            is_sent = number < len(QUALITY_FACTORS)
            change = f"sent at {QUALITY_FACTORS[number]:.0%} of their quality" if is_sent else "omitted"
            limit = self.engineio.max_payload
            self._metrics.warn("pictures", f"telemetry exceeds the limit of {limit} characters; images are {change}")
        self._quality = number

    def _data(self, frame: Frame, images: devkit.Images | None) -> dict[str, str]:
        """Telemetry for the profile of the script; for all profiles while it is unknown, or if it is probably wrong."""
        detection, flow = self._detection, self.flow_control
        lidar = detection.lidar(flow)
        profile = detection.profile
        is_uncertain = detection.fixed is None and flow.resends > 1
        contents: dict[str, Any] = {
            "traffic_lights": self._traffic_lights,
            "images": images,
            "image_sizes": self._image_sizes(),
        }
        if profile is None or is_uncertain:
            return devkit.initial_telemetry(frame, settings=detection.settings, lidar=lidar, **contents)
        return devkit.telemetry(frame, replace(profile, lidar=lidar), **contents)


def _commands_in(event: Event) -> dict[str, Any]:
    match event:
        case Event(name=name, arguments=[dict() as data, *_]) if name == EVENT:
            return data
    raise PacketError(f"event '{event.name[:40]}' without commands; expected '{EVENT}' with a dictionary")
