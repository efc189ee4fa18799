"""Messages as short texts for a prompt, and as tables and drawings for a notebook."""

from __future__ import annotations

import enum
import html
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from autodrive.base.arrays import read_only_copy
from autodrive.base.suggest import suggest
from autodrive.base.svg_plot import svg

Frame = VehicleFrame = LidarScan = Pose = Any
"""Messages of `messages`, which imports this module."""


class Displayed(msgspec.Struct, frozen=True, gc=False):
    """Base of messages with arrays: their text is one line, and a notebook shows a table of their fields.

    The arrays of a copied or unpickled message are read-only, too.
    """

    def __reduce__(self) -> tuple[Any, ...]:
        return _with_read_only_arrays, (type(self), [getattr(self, field) for field in self.__struct_fields__])

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={text}' for name, text in _fields(self))})"

    def _repr_html_(self) -> str | None:
        return table(type(self).__name__, list(_fields(self)))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise unknown_attribute(self, name)


def unknown_attribute(message: object, name: str) -> AttributeError:
    """The error for an attribute that a message does not have, which says which there are."""
    kind = type(message).__name__
    known = [word for word in dir(type(message)) if not word.startswith("_")]
    text = f"'{kind}' has no attribute '{name}'. {suggest(name, known)}"
    return AttributeError(text, name=name, obj=None)  # without the object, Python adds no suggestion of its own


def _with_read_only_arrays(kind: type[Displayed], values: Sequence[Any]) -> Displayed:
    """A message from the values of its fields; pickle forgets that arrays are read-only."""
    return kind(
        *(
            read_only_copy(value) if isinstance(value, np.ndarray) and value.flags.writeable else value
            for value in values
        )
    )


def short(value: Any) -> str:
    """The text of a value: numbers with at most six digits, long arrays as their length and range."""
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, float):
        return f"{value:.6g}"
    if not isinstance(value, np.ndarray):
        return repr(value)
    if value.ndim > 1:
        return f"<{value.dtype}, shape {value.shape}>"
    if value.size <= 4:
        return f"[{', '.join(f'{number:.4g}' for number in value.tolist())}]"
    finite = value[np.isfinite(value)]
    return f"<{value.size} values{f' from {finite.min():.4g} to {finite.max():.4g}' if finite.size else ''}>"


def vehicle_text(vehicle: VehicleFrame) -> str:
    """Pose, speed, actuators, collisions and the cameras that have an image, in one line."""
    cameras = ", ".join(vehicle.cameras) or "no camera"
    return (
        f"<VehicleFrame {_motion(vehicle)}, throttle {short(vehicle.throttle)}, "
        f"steering {short(vehicle.steering)} rad, {vehicle.collision_count} collisions, images of {cameras}>"
    )


def frame_text(frame: Frame) -> str:
    """Time, pose and speed of each vehicle, number of objects, and events, in one line."""
    vehicles = "; ".join(f"{name} {_motion(vehicle)}" for name, vehicle in frame.vehicles.items())
    events = ", ".join(repr(event) for event in frame.events) or "no events"
    return f"<Frame at {short(frame.time)} s, tick {frame.tick}: {vehicles}; {len(frame.objects)} objects; {events}>"


def frame_html(frame: Frame) -> str:
    """A row for each vehicle, then a line for each event."""
    head = ("vehicle", "x [m]", "y [m]", "yaw [rad]", "speed [m/s]", "throttle", "steering [rad]", "nearest range [m]")
    rows = [
        (
            name,
            *(f"{number:.2f}" for number in (*vehicle.pose.position[:2], _yaw(vehicle.pose), vehicle.speed)),
            short(vehicle.throttle),
            f"{vehicle.steering:.2f}",
            "" if vehicle.lidar is None else f"{vehicle.lidar.ranges.min():.2f}",
        )
        for name, vehicle in frame.vehicles.items()
    ]
    events = "".join(f"<div>{html.escape(repr(event))}</div>" for event in frame.events)
    return table(f"Frame at {frame.time:.2f} s, tick {frame.tick}", rows, head) + events


def scan_svg(scan: LidarScan, size: int = 300) -> str:
    """The points of a scan seen from above, x upward; the ring is the largest range that was measured."""
    is_hit = np.isfinite(scan.ranges)
    angles = (scan.angle_min + scan.angle_increment * np.arange(scan.ranges.size))[is_hit]
    ranges = scan.ranges[is_hit]
    reach = float(ranges.max(initial=scan.range_min))
    points = "".join(
        f'<circle cx="{-r * math.sin(a):.3f}" cy="{-r * math.cos(a):.3f}" r="{0.012 * reach:.4f}"/>'
        for a, r in zip(angles.tolist(), ranges.tolist(), strict=True)
    )
    return svg(
        size,
        size,
        f"<title>{ranges.size} of {scan.ranges.size} rays, up to {reach:.2f} m</title>",
        f'<circle r="{reach:.3f}" fill="#f4f6f8" stroke="#9aa4ae" stroke-width="{0.006 * reach:.4f}"/>',
        f'<path d="M0 {-0.08 * reach:.3f} L{0.05 * reach:.3f} {0.06 * reach:.3f} H{-0.05 * reach:.3f} Z" '
        f'fill="#ff3b30"/><g fill="#1666a8">{points}</g>',
        box=(-1.1 * reach, -1.1 * reach, 2.2 * reach, 2.2 * reach),
    )


def table(title: str, rows: Sequence[Sequence[str]], head: Sequence[str] = ()) -> str:
    """An HTML table."""
    cells = [("th", head)] * bool(head) + [("td", row) for row in rows]
    lines = ("".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in row) for tag, row in cells)
    return f"<table><caption>{html.escape(title)}</caption>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"


def _yaw(pose: Pose) -> float:
    from autodrive.base.transforms import yaw_from_quaternion  # noqa: PLC0415  loads Numba, which the messages do not need

    return yaw_from_quaternion(pose.orientation)


def _motion(vehicle: VehicleFrame) -> str:
    x, y, _ = vehicle.pose.position
    return f"at ({x:.2f}, {y:.2f}) m, yaw {_yaw(vehicle.pose):.2f} rad, speed {vehicle.speed:.2f} m/s"


def _fields(message: msgspec.Struct) -> Iterator[tuple[str, str]]:
    for name in message.__struct_fields__:
        yield name, short(getattr(message, name))
