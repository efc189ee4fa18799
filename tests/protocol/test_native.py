"""Encoded messages of the native protocol, checked with another implementation of MessagePack."""

from __future__ import annotations

import contextlib
import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import msgpack
import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import autodrive
from autodrive.protocol import native
from autodrive.protocol.codec import decode_client, decode_server, encode, streamed
from autodrive.protocol.cpp import header
from autodrive.protocol.messages import Collision, Command, Frame, LidarScan, Pose, Step
from autodrive.protocol.typescript import declarations
from tests.support.frames import bytes_of

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def frame() -> Frame:
    """With a scan, a movable box and a collision."""
    world = autodrive.make("boxes")
    while world.time < 0.3:
        world.step({"V1": Command(0.5, 0.2)})
    position = np.array([1.0, 2.0, 0.1])
    return msgspec.structs.replace(world.frame, events=(Collision(0.3, "V1", "box_1", 0.02, position),))


def test_a_streamed_frame_comes_back_bit_for_bit(frame: Frame) -> None:
    sent = streamed(frame, frame.events)
    assert all(vehicle.lidar is None for vehicle in sent.vehicles.values())
    assert list(bytes_of(decode_server(encode(sent)))) == list(bytes_of(sent))


def test_a_scan_keeps_its_infinities(frame: Frame) -> None:
    scan = frame.vehicles["V1"].lidar
    assert scan is not None
    odd = msgspec.structs.replace(scan, ranges=np.array([math.inf, -math.inf, 0.5, math.nan]))
    back = decode_server(encode(native.Scan("V1", odd)))
    assert isinstance(back, native.Scan)
    np.testing.assert_array_equal(back.scan.ranges, odd.ranges)


def test_arrays_that_were_received_cannot_be_changed(frame: Frame) -> None:
    back = decode_server(encode(streamed(frame, ())))
    assert isinstance(back, Frame)
    with pytest.raises(ValueError, match="read-only"):
        back.vehicles["V1"].pose.position[0] = 0.0


def test_another_implementation_reads_the_same_numbers(frame: Frame) -> None:
    plain = msgpack.unpackb(encode(streamed(frame, frame.events)), ext_hook=_values)
    vehicle = frame.vehicles["V1"]
    assert (plain["type"], plain["tick"], plain["scene_light"]) == ("Frame", frame.tick, True)
    assert plain["vehicles"]["V1"]["pose"]["position"] == tuple(vehicle.pose.position)
    assert plain["vehicles"]["V1"]["encoders"]["ticks"] == tuple(vehicle.encoders.ticks)
    assert plain["events"][0]["type"] == "Collision"
    assert plain["events"][0]["other"] == "box_1"


def test_messages_of_another_implementation_are_decoded() -> None:
    text = msgpack.packb(
        {"type": "Request", "id": 3, "operation": {"type": "Step", "ticks": 2, "commands": {"V1": {"throttle": 0.5}}}}
    )
    assert text is not None
    assert decode_client(text) == native.Request(3, Step(2, {"V1": Command(0.5)}))


def _values(code: int, data: bytes) -> tuple[Any, ...]:
    """An extension as the documentation has it: code 1 is float64, 2 int64, 3 float32, 4 uint8, little-endian."""
    kind, size = {1: ("d", 8), 2: ("q", 8), 3: ("f", 4), 4: ("B", 1)}[code]
    return struct.unpack(f"<{len(data) // size}{kind}", data)


@pytest.mark.parametrize(
    ("message", "text"),
    [
        ({"type": "Drive", "vehicle": 1, "command": {}}, r"Expected `str`, got `int` - at `\$.vehicle`"),
        ({"type": "Drive", "command": {}}, "missing required field `vehicle`"),
        ({"type": "Drove"}, "Invalid value 'Drove'"),
        ({"type": "Drive", "vehicle": "V1", "command": {"headlights": 7}}, "Invalid enum value 7"),
        ({}, "missing required field `type`"),
    ],
)
def test_the_error_of_an_invalid_message_names_cause_and_place(message: dict[str, Any], text: str) -> None:
    data = msgpack.packb(message)
    assert data is not None
    with pytest.raises(msgspec.ValidationError, match=text):
        decode_client(data)


@given(st.binary(max_size=200))
def test_random_bytes_raise_only_decoding_errors(data: bytes) -> None:
    for decode in (decode_client, decode_server):
        with contextlib.suppress(msgspec.DecodeError, ValueError):
            decode(data)


def test_the_typescript_of_the_page_is_that_of_the_messages() -> None:
    written = (ROOT / "web" / "src" / "messages.ts").read_text(encoding="utf-8")
    assert written == declarations(), "run scripts/generate-messages"


def test_the_cpp_header_of_the_client_is_that_of_the_messages() -> None:
    written = (ROOT / "clients" / "cpp" / "include" / "autodrive" / "messages.hpp").read_text(encoding="utf-8")
    assert written == header(), "run scripts/generate-messages"


def test_every_array_has_its_extension_in_typescript() -> None:
    text = declarations()
    assert "{ 1: Float64Array, 2: BigInt64Array, 3: Float32Array, 4: Uint8Array, 5: Uint16Array }" in text
    assert "  ranges: Float64Array\n" in text
    assert "  ticks: BigInt64Array\n" in text


def _structs(of: Any) -> Iterator[type]:
    yield from get_args(of) or (of,)


def test_the_document_names_every_message() -> None:
    document = (ROOT / "docs" / "protocol.md").read_text(encoding="utf-8")
    every = {one.__name__ for one in (*_structs(native.ClientMessage), *_structs(native.ServerMessage))}
    asked = {one.__name__ for one in _structs(native.ServerOperation)}
    assert not {name for name in every | asked if f"`{name}`" not in document}


def test_a_pose_and_a_scan_are_small() -> None:
    """A scan of 360 rays is its numbers and not much more: 2 x 360 x 8 bytes."""
    scan = LidarScan(0.0, np.zeros(360), np.zeros(360), 0.0, 0.01, 0.15, 12.0, 7.0, 0.0, 0.0)
    assert len(encode(native.Scan("V1", scan))) < 2 * 360 * 8 + 250
    assert len(encode(Pose(np.zeros(3), np.zeros(4)))) < 7 * 8 + 40
