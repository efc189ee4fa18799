"""A single client, without sockets: which messages it is sent, and that the last Frame is always sent."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import pytest
from msgspec.structs import replace

from autodrive.connect.server.connected_client import ConnectedClient
from autodrive.connect.server.encoded_frames import EncodedFrames
from autodrive.connect.server.ways import WayNotes
from autodrive.protocol.codec import decode_server
from autodrive.protocol.messages import Frame
from autodrive.protocol.native import Subscribe
from tests.protocol.devkit_frames import frame, scan, vehicle

OLD = frame(vehicle(lidar=scan([1.0] * 8)))


class Road:
    """Where a World's Frames come to one viewer, who is looked after as by a Hub."""

    def __init__(self, frame_rate: float | None) -> None:
        self.stream = EncodedFrames(None)
        self.viewer = ConnectedClient("one", self.stream, WayNotes())
        self.viewer.subscribe(Subscribe(frame_rate=frame_rate, scans=True))
        self.sent: list[str] = []
        """What was sent: the names of messages, Frames with their tick."""
        self.while_scan_is_sent: Callable[[], object] = lambda: None
        self._is_early = False

    def news(self, new: Frame) -> None:
        self.stream.latest = new
        self.look()

    def look(self) -> None:
        self._is_early = self.viewer.offer(self.stream.latest or OLD, (), asyncio.get_running_loop().time())

    async def send(self, data: bytes) -> None:
        message = decode_server(data)
        self.sent.append(f"Frame {message.tick}" if isinstance(message, Frame) else type(message).__name__)
        await asyncio.sleep(0)
        if self.sent[-1] == "Scan":
            brought, self.while_scan_is_sent = self.while_scan_is_sent, lambda: None
            brought()

    async def go_on(self) -> None:
        """Until all has been sent that will ever be, if no more Frames come."""
        speaking = asyncio.create_task(self.viewer.send_loop(self.send))
        for _ in range(20):
            await asyncio.sleep(0.005)
            if self._is_early:
                self.look()
        speaking.cancel()


@pytest.mark.parametrize("frame_rate", [None, 50.0])
def test_a_frame_that_comes_while_the_scan_of_one_before_is_sent_is_sent_too(frame_rate: float | None) -> None:
    async def drive() -> list[str]:
        road = Road(frame_rate)
        road.while_scan_is_sent = lambda: road.news(replace(OLD, tick=2))
        road.news(replace(OLD, tick=1))
        await road.go_on()
        return road.sent

    assert asyncio.run(drive()) == ["Scan", "Frame 1", "Frame 2"]


def test_a_frame_that_becomes_due_while_a_scan_is_sent_is_sent() -> None:
    async def drive() -> list[str]:
        road = Road(frame_rate=0.0)

        def take_frames() -> None:
            road.viewer.subscribe(Subscribe(frame_rate=50.0, scans=True))
            road.news(replace(OLD, tick=2))

        road.while_scan_is_sent = take_frames
        road.news(replace(OLD, tick=1))
        await road.go_on()
        return road.sent

    assert asyncio.run(drive()) == ["Scan", "Frame 2"]


@pytest.mark.parametrize(("is_wanted", "sent"), [(False, ["Scan"]), (True, ["Scan", "Frame 4"])])
def test_a_client_can_have_the_frame_of_each_scan_beyond_its_rate(is_wanted: bool, sent: list[str]) -> None:
    async def drive() -> list[str]:
        road = Road(frame_rate=1e-3)
        road.viewer.subscribe(Subscribe(frame_rate=1e-3, scans=True, frames_of_readings=is_wanted))
        for tick in (1, 2):  # the second one begins the period of the rate
            road.news(replace(OLD, tick=tick))
            await road.go_on()
        road.sent.clear()
        road.news(replace(OLD, tick=3))  # with the same scan
        road.news(replace(frame(vehicle(lidar=scan([2.0] * 8))), tick=4))
        await road.go_on()
        return road.sent

    assert asyncio.run(drive()) == sent
