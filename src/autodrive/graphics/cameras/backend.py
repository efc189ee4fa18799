"""What a World asks of its cameras: `CameraBackend`, and Frames with images put into them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from msgspec.structs import replace

from autodrive.protocol import messages
from autodrive.protocol.messages import CameraImage, Frame

Images = Mapping[tuple[str, str], CameraImage]
"""Images by (name of the vehicle, name of the camera)."""


class CameraBackend(Protocol):
    """Draws the cameras of a World: `TickCameras` in the tick, `ProcessCameras` asynchronously."""

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        """The Frame with the latest image of every camera.

        `redraw`: objects were moved or the scene light was switched between ticks, so every image is outdated.
        """
        ...

    def reset(self, seed: int) -> None:
        """Discard all images; image noise restarts from `seed`."""
        ...

    def save(self) -> Any:
        """Everything that later images depend on, for `restore`."""
        ...

    def restore(self, saved: Any) -> None:
        """Continue from a `save`."""
        ...

    def close(self) -> None:
        """Free all that drawing needs."""
        ...

    @property
    def has_pending_images(self) -> bool:
        """Whether an image of the latest Frame is still to come."""
        ...

    @property
    def is_thread_bound(self) -> bool:
        """Whether `update` must always be called in the same thread."""
        ...


class NoCameras:
    """The backend of a World without cameras."""

    has_pending_images = is_thread_bound = False

    def update(self, frame: Frame, *, redraw: bool = False) -> Frame:
        """Return the Frame as it is, without images."""
        return frame

    def reset(self, seed: int) -> None:
        """Nothing."""

    def save(self) -> None:
        """Nothing."""

    def restore(self, saved: Any) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def with_images(frame: Frame, images: Images) -> Frame:
    """The Frame with these images in place of its own; the same object if it has them already."""
    if all(frame.vehicles[vehicle].cameras.get(camera) is image for (vehicle, camera), image in images.items()):
        return frame
    own: dict[str, messages.Images] = {}
    for (vehicle, camera), image in images.items():
        own.setdefault(vehicle, messages.Images())[camera] = image
    vehicles = {
        name: replace(vehicle, cameras=own[name]) if name in own else vehicle
        for name, vehicle in frame.vehicles.items()
    }
    return replace(frame, vehicles=vehicles)
