"""The cameras of all vehicles: who they are, when they are due, and eyes that draw for them in the tick itself."""

from __future__ import annotations

import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

from msgspec.structs import replace

from autodrive.assets import scene_of
from autodrive.protocol.messages import CameraImage, Frame
from autodrive.render.gl import probe
from autodrive.render.moment import Moment
from autodrive.render.renderer import Renderer
from autodrive.render.scene import Scene
from autodrive.sensors.camera import Camera, CameraSpec

if TYPE_CHECKING:
    from autodrive.compile import Compiled

Images = Mapping[tuple[str, str], CameraImage]
"""By (name of the vehicle, name of the camera)."""


class Eyes(Protocol):
    """Whoever gives Frames their pictures."""

    def see(self, frame: Frame, *, anew: bool = False) -> Frame:
        """The Frame with the latest picture of every camera.

        `anew`: something was moved by hand or the scene light was switched, so that every picture is outdated.
        """
        ...

    def reset(self, seed: int) -> None:
        """Forget every picture; noise follows from `seed`."""
        ...

    def save(self) -> Any:
        """Everything that the future depends on, for `restore`."""
        ...

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        ...

    def close(self) -> None:
        """Give back all that drawing needs."""
        ...

    @property
    def is_awaited(self) -> bool:
        """Whether a picture of the latest Frame is still to come."""
        ...

    @property
    def belongs_to_thread(self) -> bool:
        """Whether only the thread that has seen before may see again."""
        ...


class Seat(NamedTuple):
    """A camera's place: on which vehicle, and what it is."""

    row: int
    """Of the vehicle, in a Moment."""
    vehicle: str
    camera: str
    spec: CameraSpec


@dataclass(frozen=True)
class Sight:
    """All that pictures are made of, once a world; it can be sent to another process."""

    scene: Scene
    seats: tuple[Seat, ...]
    substep: Fraction
    """[s]."""
    substeps: int
    """In a tick."""
    quality: str
    """One of `render.quality.NAMES`."""


def sight_of(compiled: Compiled, quality: str = "auto") -> Sight:
    """What the cameras of that world are, and what they look at."""
    seats = [
        Seat(row, vehicle, camera, spec)
        for row, (vehicle, cameras) in enumerate(compiled.cameras.items())
        for camera, spec in cameras.items()
    ]
    return Sight(
        scene=scene_of(compiled),
        seats=tuple(seats),
        substep=Fraction(str(compiled.spec.substep)),
        substeps=compiled.spec.substeps,
        quality=quality,
    )


class Film:
    """All cameras of a world."""

    def __init__(self, sight: Sight) -> None:
        self._sight = sight
        self.cameras = [
            Camera(seat.spec, vehicle=seat.vehicle, name=seat.camera, substep=sight.substep) for seat in sight.seats
        ]
        self._wants = {
            "depth": any(seat.spec.depth for seat in sight.seats),
            "labels": any(seat.spec.labels for seat in sight.seats),
        }

    def reset(self, seed: int) -> None:
        """Begin anew; noise follows from `seed`."""
        for camera in self.cameras:
            camera.reset(seed)

    def due(self, tick: int) -> list[int]:
        """Numbers of the cameras that take a picture at that tick."""
        now = tick * self._sight.substeps
        return [number for number, camera in enumerate(self.cameras) if camera.is_due(now)]

    def take(self, renderer: Renderer, moment: Moment, tick: int, numbers: Sequence[int]) -> list[CameraImage]:
        """The pictures of these cameras, all of one moment, drawn together."""
        now = tick * self._sight.substeps
        rows = [moment.vehicles[self._sight.seats[number].row] for number in numbers]
        views = [self.cameras[number].views(row, moment.time) for number, row in zip(numbers, rows, strict=True)]
        pictures = iter(renderer.draw(moment, [view for own in views for view in own], **self._wants))
        return [
            self.cameras[number].develop([next(pictures) for _ in own], row, now)
            for number, own, row in zip(numbers, views, rows, strict=True)
        ]


class Cameras:
    """Eyes that draw in the tick, for exactly the state that the Frame shows: the same bytes each run.

    Raises `GlUnavailable` at once if there is something to draw and nothing to draw it with.
    """

    def __init__(self, sight: Sight) -> None:
        self._sight = sight
        self._film = Film(sight)
        self._latest: dict[tuple[str, str], CameraImage] = {}
        self._renderer: Renderer | None = None
        if sight.seats:
            probe()

    def see(self, frame: Frame, *, anew: bool = False) -> Frame:
        """The Frame with the latest picture of every camera; those that are due are drawn now."""
        due = range(len(self._sight.seats)) if anew else self._film.due(frame.tick)
        if due:
            images = self._film.take(self._drawing(), Moment.of(frame), frame.tick, due)
            names = [self._sight.seats[number][1:3] for number in due]
            self._latest = {**self._latest, **dict(zip(names, images, strict=True))}
        return with_images(frame, self._latest)

    def reset(self, seed: int) -> None:
        """Forget every picture; noise follows from `seed`."""
        self._latest = {}
        self._film.reset(seed)

    def save(self) -> Any:
        """The latest pictures, and the noise to come."""
        return self._latest, [camera.save() for camera in self._film.cameras]

    def restore(self, saved: Any) -> None:
        """Go on as from the moment of `save`."""
        self._latest, cameras = saved
        for camera, one in zip(self._film.cameras, cameras, strict=True):
            camera.restore(one)

    @property
    def is_awaited(self) -> bool:
        """Never: a Frame comes with its pictures."""
        return False

    @property
    def belongs_to_thread(self) -> bool:
        """OpenGL's context does."""
        return True

    def close(self) -> None:
        """Give back what the graphics side holds; the next picture would fetch it again."""
        if self._renderer is not None:
            self._release()
            self._renderer = None

    def _drawing(self) -> Renderer:
        """The renderer, made when the first picture is due."""
        if self._renderer is None:
            self._renderer = Renderer(self._sight.scene, self._sight.quality)
            self._release = weakref.finalize(self, self._renderer.release)
        return self._renderer


def with_images(frame: Frame, images: Images) -> Frame:
    """The Frame with these pictures in the place of its own; the very same if it has them."""
    if all(frame.vehicles[vehicle].cameras.get(camera) is image for (vehicle, camera), image in images.items()):
        return frame
    own: dict[str, dict[str, CameraImage]] = {}
    for (vehicle, camera), image in images.items():
        own.setdefault(vehicle, {})[camera] = image
    vehicles = {
        name: replace(vehicle, cameras=own[name]) if name in own else vehicle
        for name, vehicle in frame.vehicles.items()
    }
    return replace(frame, vehicles=vehicles)
