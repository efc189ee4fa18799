"""The chassis: acrylic platforms on standoffs, drive, battery and steering servo."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
import shapely
import shapely.affinity

from autodrive.base.units import DEGREE
from autodrive.graphics.meshes.mesh_builder import MeshBuilder
from autodrive.graphics.meshes.solids import box, cylinder, lathe, plate, wire
from autodrive.physics.actuators.steering import ackermann_angle
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.scenario.vehicles.spec import ColliderSpec, VehicleSpec

CORNER = 0.016
"""Corner radius of the platforms [m]."""
BATTERY_SIZE, BATTERY_X = (0.118, 0.042, 0.026), 0.035
"""Size of the battery, and x of its centre [m]."""
HOLE = 0.0016
"""Radius of a mounting hole: M3 [m]."""


def add_platforms(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The platforms, with holes, slots, and cut-outs for steered wheels and fields of view of cameras."""
    for number, platform in enumerate(spec.platforms):
        outline = _outline(builder, spec, platform)
        if builder.has_small_parts:
            outline = outline.difference(shapely.union_all(list(_holes(platform, number))))
        bottom, top = span(platform)
        builder.add("acrylic", plate(outline, bottom, top))


def _outline(builder: MeshBuilder, spec: VehicleSpec, platform: ColliderSpec) -> shapely.Polygon:
    x0, x1, y0, y1 = edges(platform)
    quads = max(2, builder.n // 8)
    outline = shapely.box(x0 + CORNER, y0 + CORNER, x1 - CORNER, y1 - CORNER).buffer(CORNER, quad_segs=quads)
    bottom, top = span(platform)
    radius, half = spec.wheels.radius, 0.5 * spec.wheels.width
    if bottom < radius + 0.012:  # at the height of a wheel: clearance for steering and suspension travel
        # of the inner wheel
        lock = float(ackermann_angle(spec.steering.largest_angle, spec.wheelbase, 0.5 * spec.track))
        reach = radius * math.sin(lock) + half * math.cos(lock) + 0.003
        for i, (x, y, _) in enumerate(spec.hubs):
            inner = reach if i < 2 else half + 0.003
            room = shapely.box(x - radius - 0.004, abs(y) - inner, x + radius + 0.004, abs(y) + 0.1)
            room = room if y > 0.0 else shapely.affinity.scale(room, 1.0, -1.0, origin=(0.0, 0.0))
            outline = outline.difference(room.buffer(0.002, quad_segs=2))
    for camera in spec.cameras.values():
        if 0.0 <= camera.mount.position[2] - top < 0.03:
            outline = outline.difference(_sight(camera, top))
    parts = list(shapely.get_parts(outline))
    return max(parts, key=lambda part: part.area)


def _sight(camera: CameraSpec, top: float) -> shapely.Polygon:
    """What a camera would see of a plate below it, and a little more."""
    x, y, z = camera.mount.position
    _, pitch, yaw = (angle * DEGREE for angle in camera.mount.rotation_deg)
    k = camera.intrinsics
    aside, down = 0.5 * k.width / k.fx, pitch + math.atan(0.5 * k.height / k.fy)
    if not 0.0 < down < 0.5 * math.pi:
        return shapely.Polygon()
    near, far = max(0.0, (z - top) / math.tan(down) - 0.002), 0.3
    sides = [(d, (d * math.cos(pitch) + (z - top) * math.sin(pitch)) * aside + 0.001) for d in (near, far)]
    wedge = shapely.Polygon([(d, w) for d, w in sides] + [(d, -w) for d, w in reversed(sides)])
    return shapely.affinity.translate(
        shapely.affinity.rotate(wedge.buffer(0.001, quad_segs=2), yaw, origin=(0, 0), use_radians=True), x, y
    )


def _holes(platform: ColliderSpec, number: int) -> Iterator[shapely.Polygon]:
    """A row of holes along each side, and slots for cables."""
    x0, x1, y0, y1 = edges(platform)
    for x in np.linspace(x0 + 0.030, x1 - 0.030, round((x1 - x0) / 0.026)):
        for y in (y0 + 0.0075, y1 - 0.0075):
            yield shapely.Point(x, y).buffer(HOLE, quad_segs=3)
    middle = 0.5 * (x0 + x1)
    for x in (middle - 0.055, middle + 0.02) if number else ():
        for y in (y0 + 0.024, y1 - 0.024):
            yield shapely.LineString([(x - 0.009, y), (x + 0.009, y)]).buffer(0.0026, quad_segs=4)


def add_standoffs(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Brass standoffs between each two platforms, with screws on top and nuts below."""
    for lower, upper in pairwise(sorted(spec.platforms, key=lambda platform: platform.position[2])):
        low, high = span(lower)[1], span(upper)[0]
        a, b = edges(lower), edges(upper)
        x0, x1, y = max(a[0], b[0]) + 0.011, min(a[1], b[1]) - 0.011, min(a[3], b[3]) - 0.011
        xs = [x for x in np.linspace(x0, x1, 3 if x1 - x0 > 0.15 else 2) if _is_free(spec, x, y, low, high)]
        for x in xs:
            for side in (-y, y):
                builder.add("brass", cylinder(0.0031, high - low, (x, side, 0.5 * (low + high)), n=6))
                if builder.has_small_parts:
                    head = [(0.0, 0.0), (0.0029, 0.0), (0.0027, 0.0011), (0.0016, 0.0019), (0.0, 0.0021)]
                    builder.add("steel", lathe(head, (x, side, span(upper)[1]), n=10))
                    builder.add("steel", cylinder(0.0030, 0.0022, (x, side, span(lower)[0] - 0.0011), n=6))


def _is_free(spec: VehicleSpec, x: float, y: float, low: float, high: float) -> bool:
    """True if a standoff at that position clears the wheels and the fields of view of the cameras."""
    radius = spec.wheels.radius
    return not any(
        low < radius and abs(x - wheel_x) < radius + 0.004 and y > abs(wheel_y) - 0.028
        for wheel_x, wheel_y, _ in spec.hubs
    ) and not any(
        low - 0.01 < camera.mount.position[2] < high + 0.01 and abs(x - camera.mount.position[0]) < 0.02 and y < 0.03
        for camera in spec.cameras.values()
    )


def add_drive(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Two TT gear motors on the first platform, their axles in the rear wheels, and their driver board."""
    floor, inner = span(spec.platforms[0])[1], 0.5 * spec.track - 0.5 * spec.wheels.width
    y = inner - 0.0135
    for side in (-1.0, 1.0):
        bevel = 0.004 if builder.has_small_parts else 0.0
        builder.add("motor", box((0.058, 0.0187, 0.0222), (0.017, side * y, 0.0), bevel))
        builder.add("motor", box((0.010, 0.012, 0.016), (-0.016, side * y, 0.0)))
        builder.add("aluminium", cylinder(0.0100, 0.024, (0.058, side * y, 0.0), "x", builder.around(0.5)))
        builder.add("black", cylinder(0.0102, 0.003, (0.0715, side * y, 0.0), "x", builder.around(0.5)))
        builder.add("white", cylinder(0.0027, 0.012, (0.0, side * (inner - 0.002), 0.0), "y", builder.around(0.3)))
        if builder.has_small_parts:
            builder.add("strap", box((0.0035, 0.0192, 0.0228), (0.0415, side * y, 0.0)))
            for x in (-0.006, 0.032):
                builder.add("steel", cylinder(0.0022, 0.0200, (x, side * y, 0.0072), "y", 8))
    x, z = 0.085, floor + 0.005
    builder.add("board_red", box((0.043, 0.043, 0.0016), (x, 0.0, z)))
    builder.add("matt_black", box((0.004, 0.023, 0.020), (x + 0.012, 0.0, z + 0.0108)))
    for fin in np.linspace(-0.010, 0.010, 6 if builder.has_small_parts else 0):
        builder.add("matt_black", box((0.012, 0.0012, 0.020), (x + 0.006, fin, z + 0.0108)))
    for block in (-0.0135, 0.0, 0.0135):
        builder.add("board_blue", box((0.008, 0.0105, 0.009), (x - 0.017, block, z + 0.0053)))
    for can in (-0.012, 0.012):
        builder.add("black", cylinder(0.004, 0.010, (x - 0.004, can, z + 0.0058), n=builder.around(0.4)))


def add_battery(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The LiPo battery, strapped on the second platform, and the converter beside it."""
    floor = span(spec.platforms[1])[1]
    size, x = BATTERY_SIZE, BATTERY_X
    z = floor + 0.5 * size[2]
    builder.add("battery", box(size, (x, 0.0, z), 0.004 if builder.has_small_parts else 0.0))
    builder.add("white", box((0.052, size[1] + 0.0006, 0.013), (x + 0.006, 0.0, z)))
    for at in (-0.036, 0.044):
        builder.add("strap", box((0.014, size[1] + 0.0022, size[2] + 0.0014), (x + at, 0.0, z)))
    x, z = 0.128, floor + 0.005
    builder.add("board_blue", box((0.046, 0.030, 0.0016), (x, 0.0, z)))
    builder.add("aluminium", cylinder(0.0056, 0.010, (x - 0.015, 0.006, z + 0.0058), n=builder.around(0.4)))
    builder.add("matt_black", box((0.013, 0.013, 0.007), (x + 0.008, 0.003, z + 0.0043)))


def add_servo(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The SG90 servo below the second platform; its shaft points down."""
    x, z = servo_shaft(spec)
    top = span(spec.platforms[1])[0]
    builder.add("servo", box((0.0228, 0.0122, top - z - 0.005), (x - 0.0055, 0.0, 0.5 * (top + z + 0.005)), 0.001, 1))
    builder.add("servo", box((0.0320, 0.0122, 0.0022), (x - 0.0055, 0.0, z + 0.012)))
    builder.add("servo", cylinder(0.0058, 0.0045, (x, 0.0, z + 0.004), n=builder.around(0.5)))
    builder.add("white", cylinder(0.0022, 0.004, (x, 0.0, z + 0.001), n=builder.around(0.3)))
    axle = 0.5 * spec.track - 0.5 * spec.wheels.width
    front = spec.wheelbase
    # the beam that carries the knuckles
    builder.add("acrylic", box((0.014, 2.0 * axle - 0.030, 0.003), (front, 0.0, 0.0105)))
    for side in (-1.0, 1.0):
        builder.add("brass", cylinder(0.0028, top - 0.0120, (front, side * (axle - 0.024), 0.5 * (top + 0.012)), n=6))
    if builder.has_small_parts:
        for y, material in ((-0.0015, "black"), (0.0, "wire_red"), (0.0015, "wire_orange")):
            way = [(x - 0.016, y, 0.012), (x - 0.026, y, 0.016), (x - 0.034, 1.4 * y - 0.02, 0.022)]
            builder.add(material, wire([*way, (x - 0.036, y - 0.026, 0.034)], 0.0007, 4, 4))


def servo_shaft(spec: VehicleSpec) -> tuple[float, float]:
    """X and z of the lower end of the servo shaft [m]: ahead of the front axle, on the centre line."""
    return spec.wheelbase + 0.024, -0.003


def edges(platform: ColliderSpec) -> tuple[float, float, float, float]:
    """x_min, x_max, y_min, y_max [m]."""
    (x, y, _), (length, width, _) = platform.position, platform.size
    return x - 0.5 * length, x + 0.5 * length, y - 0.5 * width, y + 0.5 * width


def span(platform: ColliderSpec) -> tuple[float, float]:
    """Z of the bottom and of the top [m]."""
    return platform.position[2] - 0.5 * platform.size[2], platform.position[2] + 0.5 * platform.size[2]
