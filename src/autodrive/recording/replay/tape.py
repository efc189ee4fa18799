"""A recording as players and films need it: times from 0, scenarios as Specs, readings that keep their identity."""

from __future__ import annotations

import bisect
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from itertools import islice
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from msgspec.structs import replace

from autodrive import recording as recordings
from autodrive.base.errors import CommandError
from autodrive.protocol.drawing import drawn_after
from autodrive.protocol.messages import (
    CameraImage,
    Draw,
    Event,
    Frame,
    Images,
    LidarScan,
    LoadScenario,
    Reset,
    VehicleFrame,
)
from autodrive.protocol.native import Drawn
from autodrive.protocol.replay import Mark, Timeline
from autodrive.world.observer import ResetTo

if TYPE_CHECKING:
    from autodrive.recording import Moment
    from autodrive.scenario import ScenarioSpec

INSTANT = 1e-9
"""Resolution of times in a recording [s]."""


class Tape:
    """Used by one thread at a time. Times are seconds since the first Frame of the recording.

    A scan or image that is the same in two Frames is the same object in both, as in the Frames of a World. Images are
    decoded only if `has_images` is set.
    """

    def __init__(self, path: Path) -> None:
        """Raises `RecordingError`."""
        self.name = path.name
        self.has_images = False
        self._recording = recordings.open(path)
        self._stack = ExitStack()
        self._stack.callback(self._recording.close)
        try:
            self.duration = self._recording.duration
            self.marks = [Mark(event.time - self._recording.start, event.event) for event in self._recording.events]
        except BaseException:
            self._stack.close()
            raise
        self._times = [mark.time for mark in self.marks]
        self._specs: dict[int, ScenarioSpec] = {}
        self._moment: Moment | None = None
        self._frame: Frame | None = None
        self._frame_has_images = False
        self._draws: list[tuple[float, int, Draw | None]] | None = None
        self._drawings: tuple[int, dict[str, Drawn]] = 0, {}

    def close(self) -> None:
        """Close the file, and delete what was unpacked."""
        self._stack.close()

    def __enter__(self) -> Tape:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def timeline(self) -> Timeline:
        """Name, duration and events."""
        return Timeline(self.name, self.duration, self.marks)

    @property
    def problems(self) -> list[str]:
        """What is missing or damaged in the file."""
        return self._recording.problems

    @property
    def contains_images(self) -> bool:
        """Whether images of any camera were recorded."""
        return any(self._recording.cameras(vehicle) for vehicle in self._recording.vehicles)

    def scenario_at(self, time: float) -> tuple[str, ScenarioSpec]:
        """Name and Spec of the scenario at that time; the same object while the scenario is the same."""
        record = self._recording.scenario_at(time + self._recording.start)
        if id(record) not in self._specs:
            self._specs[id(record)] = self._stack.enter_context(self._recording.scenario_spec(record))
        return record.name or record.spec.get("title", ""), self._specs[id(record)]

    def frame_at(self, time: float) -> Frame:
        """The last Frame at that time or before, without events. Raises `RecordingError`."""
        moment = self._moment_at(time)
        if self._frame is None or moment is not self._moment or self._frame_has_images != self.has_images:
            self._frame = self._shared(moment.frame, self._frame)
            self._moment, self._frame_has_images = moment, self.has_images
        return self._frame

    def time_of_frame(self, time: float, steps: int) -> float:
        """Time of the Frame that many Frames after that of a time, or before it if negative."""
        start = self._recording.start
        now = self._moment_at(time).time
        if steps > 0:
            later = islice(self._recording.moments(now + INSTANT), steps)
            for moment in later:
                now = moment.time
        for _ in range(-steps):
            before = self._recording.moment_at(now - INSTANT).time
            if before >= now:
                break
            now = before
        return max(now - start, 0.0)

    def events_between(self, after: float, until: float) -> tuple[Event, ...]:
        """Events later than a time, up to another one."""
        first, last = (bisect.bisect_right(self._times, time + INSTANT) for time in (after, until))
        return tuple(mark.event for mark in self.marks[first:last])

    def drawings_at(self, time: float) -> dict[str, Drawn]:
        """What programs had drawn into the view until that time, by name; the same objects as time passes."""
        if self._draws is None:
            start = self._recording.start
            self._draws = [
                (at - start, record.tick, request if isinstance(request, Draw) else None)
                for at, record in self._recording.requests
                if isinstance(request := record.request, Draw | Reset | LoadScenario | ResetTo)
            ]
        count = bisect.bisect_right(self._draws, time + INSTANT, key=lambda draw: draw[0])
        done, drawings = self._drawings
        if count < done:
            done, drawings = 0, {}
        for at, tick, request in self._draws[done:count]:
            if request is None:
                drawings = {}
                continue
            duration = self.scenario_at(at)[1].tick
            with suppress(CommandError):  # the file was not written by a simulator
                drawings = drawn_after(drawings, request, tick * duration)
        self._drawings = count, drawings
        return drawings

    def _moment_at(self, time: float) -> Moment:
        moment = self._recording.moment_at(time + self._recording.start + INSTANT)
        return self._moment if self._moment is not None and self._moment.time == moment.time else moment

    def _shared(self, frame: Frame, before: Frame | None) -> Frame:
        """The Frame with the scans and images of the one before that are still the latest ones."""
        known: Mapping[str, VehicleFrame] = {} if before is None else before.vehicles
        vehicles = {
            name: replace(
                vehicle,
                lidar=_same(vehicle.lidar, known[name].lidar if name in known else None),
                cameras=self._images(vehicle, known[name].cameras if name in known else {}),
            )
            for name, vehicle in frame.vehicles.items()
        }
        return replace(frame, vehicles=vehicles, events=())

    def _images(self, vehicle: VehicleFrame, known: Mapping[str, CameraImage]) -> Images:
        images = Images()
        if self.has_images:
            recorded = vehicle.cameras
            times: Mapping[str, float] = getattr(recorded, "times", {})
            for camera in recorded:
                before = known.get(camera)
                image = before if before is not None and before.time == times.get(camera) else recorded.get(camera)
                if image is not None:
                    images[camera] = image
        return images


def _same(scan: LidarScan | None, before: LidarScan | None) -> LidarScan | None:
    return before if scan is not None and before is not None and scan.time == before.time else scan
