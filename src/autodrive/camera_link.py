"""What the simulator and its camera process say to each other: orders, answers, and memory that both share."""

from __future__ import annotations

import mmap
import os
import tempfile
from typing import Any, NamedTuple, TypeAlias

import msgspec
import numpy as np

from autodrive.cameras import Seat, Sight
from autodrive.protocol.messages import CameraIntrinsics
from autodrive.render.moment import Moment


class Order(msgspec.Struct, array_like=True):
    """Take a picture of the moment in the shared memory with these cameras; `seed`: reset all noise before."""

    tick: int
    cameras: list[int]
    seed: int | None


class Ready(msgspec.Struct, tag=True):
    """The process can draw, with what is named here."""

    renderer: str


class Shot(msgspec.Struct, array_like=True):
    """What a picture is besides its pixels."""

    time: float
    position: tuple[float, ...]
    orientation: tuple[float, ...]
    intrinsics: CameraIntrinsics


class Taken(msgspec.Struct, tag=True):
    """The pictures are in the shared memory; `seconds` of wall time [s] were needed."""

    shots: list[Shot]
    """In the order of the cameras of the Order."""
    seconds: float


class Failed(msgspec.Struct, tag=True):
    """The process cannot draw, for this reason, and ends."""

    reason: str


Answer: TypeAlias = Ready | Taken | Failed

read_answer = msgspec.json.Decoder(Answer).decode
read_order = msgspec.json.Decoder(Order).decode


def line(message: Order | Answer) -> bytes:
    """As it is sent."""
    return msgspec.json.encode(message) + b"\n"


class Plate(NamedTuple):
    """Where a camera's picture is, in the shared memory."""

    rgba: np.ndarray
    depth: np.ndarray | None
    labels: np.ndarray | None


class Shared:
    """A moment and a picture of each camera, over one stretch of memory."""

    def __init__(self, descriptor: int, sight: Sight) -> None:
        vehicles, objects = len(sight.scene.vehicles), len(sight.scene.objects)
        floats = len(Moment.empty(vehicles, objects).data)
        self._memory = mmap.mmap(descriptor, Shared.size(sight))
        self._used = 0
        self.moment = Moment.on(self._array((floats,), np.float64), vehicles, objects)
        self.plates = [self._plate(seat) for seat in sight.seats]

    @staticmethod
    def size(sight: Sight) -> int:
        """[bytes]."""
        moment = Moment.empty(len(sight.scene.vehicles), len(sight.scene.objects)).data.nbytes
        pixels = [seat.spec.width * seat.spec.height for seat in sight.seats]
        return moment + 9 * sum(pixels) + 8 * 3 * len(pixels)

    @staticmethod
    def descriptor(sight: Sight) -> int:
        """Of a new file without a name, large enough."""
        if hasattr(os, "memfd_create"):
            descriptor = os.memfd_create("autodrive-cameras")
        else:
            with tempfile.TemporaryFile() as file:
                descriptor = os.dup(file.fileno())
        os.ftruncate(descriptor, Shared.size(sight))
        return descriptor

    def _plate(self, seat: Seat) -> Plate:
        size = seat.spec.height, seat.spec.width
        return Plate(
            rgba=self._array((*size, 4), np.uint8),
            depth=self._array(size, np.float32) if seat.spec.depth else None,
            labels=self._array(size, np.uint8) if seat.spec.labels else None,
        )

    def _array(self, shape: tuple[int, ...], dtype: Any) -> np.ndarray:
        array = np.ndarray(shape, dtype, self._memory, self._used)
        self._used += -(-array.nbytes // 8) * 8
        return array
