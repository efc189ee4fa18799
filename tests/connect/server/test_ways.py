"""Clients get where the vehicles were between two Frames, also if they get few Frames."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest
from msgspec.structs import replace

from autodrive.connect.server.connected_client import NO_ANSWER, ConnectedClient
from autodrive.connect.server.encoded_frames import EncodedFrames
from autodrive.connect.server.ways import WayNotes
from autodrive.protocol.codec import decode_server
from autodrive.protocol.messages import Frame
from autodrive.protocol.native import Subscribe, Ways
from tests.protocol.devkit_frames import frame, vehicle


def at(tick: int) -> Frame:
    """The vehicle `red` at x = time, in ticks of 10 ms."""
    shown = vehicle()
    time = tick / 100
    pose = replace(shown.pose, position=np.array([time, 0.0, 0.0]))
    return replace(frame(replace(shown, pose=pose)), tick=tick, time=time)


def noted(*ticks: int) -> WayNotes:
    notes = WayNotes()
    for tick in ticks:
        notes.publish(at(tick))
    return notes


def test_ten_places_are_noted_in_a_simulated_second() -> None:
    ways = noted(*range(301)).between(0.5, 2.5)
    assert ways is not None
    np.testing.assert_allclose(ways.times, np.arange(6, 25) / 10, atol=1e-9)
    np.testing.assert_allclose(ways.positions["red"].reshape(-1, 3)[:, 0], ways.times, atol=1e-9)


def test_places_before_the_time_went_back_are_left_out() -> None:
    notes = noted(*range(100), *range(31))
    ways = notes.between(-1.0, 9.0)
    assert ways is not None
    assert ways.times.tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert notes.between(0.3, 9.0) is None


@pytest.mark.parametrize("is_response", [False, True])
def test_a_client_gets_the_way_before_the_frame_that_ends_it(is_response: bool) -> None:
    """Many ticks between two Frames: those of a slow client, or of a Step."""

    async def drive() -> list[object]:
        stream, notes, sent = EncodedFrames(None), WayNotes(), []
        client = ConnectedClient("one", stream, notes)
        client.subscribe(Subscribe(ways=True))

        async def send(data: bytes) -> None:
            sent.append(decode_server(data))
            await asyncio.sleep(0)

        sending = asyncio.create_task(client.send_loop(send))
        for tick in range(501):
            notes.publish(at(tick))
            if tick in (0, 500):
                stream.latest = at(tick)
                if is_response and tick:
                    client.respond(7, stream.latest, NO_ANSWER)
                else:
                    client.offer(stream.latest, (), asyncio.get_running_loop().time() + tick)
                await asyncio.sleep(0.02)
        sending.cancel()
        return sent

    first, ways, last = asyncio.run(drive())
    assert isinstance(first, Frame)
    assert isinstance(ways, Ways)
    assert ways.times.tolist() == pytest.approx([k / 10 for k in range(1, 50)])
    assert type(last).__name__ == ("Response" if is_response else "Frame")
