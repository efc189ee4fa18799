"""The cameras of all vehicles of a world: which there are, when they are due, and how an image is captured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

from autodrive.graphics.meshes.store import scene_of
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene
from autodrive.physics.sensors.camera.camera import Camera, CameraSpec
from autodrive.protocol.messages import CameraImage

if TYPE_CHECKING:
    from autodrive.scenario.maps.map import Map
    from autodrive.scenario.maps.solids import BoxPlacement
    from autodrive.scenario.vehicles.spec import VehicleSpec


class SceneContents(NamedTuple):
    """What a world contains that can be drawn."""

    map: Map
    vehicles: dict[str, VehicleSpec]
    boxes: list[BoxPlacement]
    paints_all: bool = False
    """Whether all cars have different colours if there are several, not only race cars."""


class CameraSlot(NamedTuple):
    """One camera of one vehicle."""

    row: int
    """Row of the vehicle in a `RenderState`."""
    vehicle: str
    camera: str
    spec: CameraSpec


@dataclass(frozen=True)
class CameraRig:
    """All that images of one world are made of; it can be sent to another process."""

    contents: SceneContents
    quality: str
    """One of `render.quality.NAMES`."""
    slots: tuple[CameraSlot, ...] = ()
    substep: Fraction = Fraction(1, 1000)
    """[s]."""
    substeps: int = 1
    """Length of a tick [substeps]."""

    @property
    def scene(self) -> RenderScene:
        """What a renderer needs; read or built anew each time."""
        return scene_of(self.contents, paints_all=self.contents.paints_all)


class CameraArray:
    """The cameras of a rig, each with its schedule and its image noise."""

    def __init__(self, rig: CameraRig) -> None:
        self._rig = rig
        self.cameras = [
            Camera(slot.spec, vehicle=slot.vehicle, name=slot.camera, substep=rig.substep) for slot in rig.slots
        ]
        self._depth = any(slot.spec.depth for slot in rig.slots)
        self._labels = any(slot.spec.labels for slot in rig.slots)
        self._instances = any(slot.spec.instances for slot in rig.slots)

    def reset(self, seed: int) -> None:
        """Restart schedules and image noise; noise follows from `seed`."""
        for camera in self.cameras:
            camera.reset(seed)

    def due(self, tick: int) -> list[int]:
        """Numbers of the cameras that are due at that tick."""
        now = tick * self._rig.substeps
        return [number for number, camera in enumerate(self.cameras) if camera.is_due(now)]

    def capture(self, renderer: Renderer, state: RenderState, tick: int, numbers: Sequence[int]) -> list[CameraImage]:
        """Images of these cameras, all of the same state, drawn together."""
        now = tick * self._rig.substeps
        rows = [state.vehicles[self._rig.slots[number].row] for number in numbers]
        views = [self.cameras[number].views(row, state.time) for number, row in zip(numbers, rows, strict=True)]
        all_views = [view for own in views for view in own]
        images = renderer.draw(state, all_views, depth=self._depth, labels=self._labels, instances=self._instances)
        rendered = iter(images)
        return [
            self.cameras[number].image_from([next(rendered) for _ in own], row, now)
            for number, own, row in zip(numbers, views, rows, strict=True)
        ]
