"""The body of a small race car: chassis with suspension, motor and battery below a deck or an enclosure.

The deck has computer, LIDAR and camera mast; the enclosure has the LIDAR on its roof and the camera in its face.
Our own geometry. Its places follow the Spec: `platforms` are the chassis, and the deck or the enclosure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import shapely
import trimesh

from autodrive.base.transforms import Vector
from autodrive.graphics.meshes.mesh_builder import MeshBuilder
from autodrive.graphics.meshes.solids import box, cylinder, lathe, plate, rotated, wire
from autodrive.graphics.meshes.vehicle_chassis import edges, span
from autodrive.physics.actuators.steering import ackermann_angle
from autodrive.scenario.vehicles.spec import VehicleSpec

FLOOR = 0.0035
"""Thickness of the floor of the chassis [m]."""
LIDAR_SIZE = 0.050
"""Edge of the base of the UST-10LX [m]."""


def add_racer(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The whole body, without wheels, steering linkage, lamps and the window of the LIDAR."""
    _add_chassis(builder, spec)
    _add_drive(builder, spec)
    for axle_x in (0.0, spec.wheelbase):
        _add_suspension(builder, spec, axle_x)
    if spec.look == "enclosed":
        _add_enclosure(builder, spec)
        _add_wing(builder, spec)
    else:
        _add_deck(builder, spec)
        _add_computer(builder, spec)
    _add_lidar_base(builder, spec)
    _add_cameras(builder, spec)


def add_racer_lidar_window(builder: MeshBuilder) -> None:
    """The dark window of the LIDAR and its cap, around the origin of the LIDAR."""
    n = builder.around(0.7)
    builder.add("glass", lathe([(0.0, -0.0155), (0.0235, -0.0155), (0.0205, 0.0105), (0.0, 0.0105)], n=n))
    builder.add("matt_black", lathe([(0.0, 0.0105), (0.0215, 0.0105), (0.0205, 0.0140), (0.0, 0.0145)], n=n))


def _add_chassis(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Floor, bumpers of foam, side pods and nose."""
    x0, x1, y0, y1 = edges(spec.platforms[0])
    bottom, top = span(spec.platforms[0])
    deck = span(spec.platforms[1])[0]
    quads = max(2, builder.n // 8)
    front, half = spec.wheelbase, y1
    edge = [(x0 + 0.012, 0.6 * half), (0.05, 0.75 * half), (0.085, half), (front - 0.085, half)]
    edge += [(front - 0.045, 0.62 * half), (x1 - 0.018, 0.55 * half)]
    floor = shapely.Polygon(edge + [(x, -y) for x, y in reversed(edge)])
    floor = floor.buffer(-0.004).buffer(0.004, quad_segs=quads)
    builder.add("carbon", plate(floor, bottom, bottom + FLOOR))
    for end, inner, way in ((x1, x1 - 0.030, 1.0), (x0, x0 + 0.022, -1.0)):
        block = shapely.box(min(inner, end), y0, max(inner, end), y1)
        round_end = shapely.Point(end - way * 1.6 * half, 0.0).buffer(1.6 * half, quad_segs=2 * quads)
        builder.add("matt_black", plate(block.intersection(round_end), bottom + 0.004, top + 0.008))
        lip = block.intersection(round_end).buffer(-0.003).intersection(shapely.box(end - 0.016, y0, end + 0.016, y1))
        builder.add("shell", plate(lip, top + 0.008, top + 0.0105))
    _, deck_end, _, width = edges(spec.platforms[1])
    for side in (-1.0, 1.0):
        edge = [(0.078, half - 0.004), (0.092, width), (front - 0.112, width), (front - 0.078, half - 0.004)]
        pod = shapely.Polygon([(x, side * y) for x, y in edge]).buffer(0.002, quad_segs=quads)
        builder.add("shell", plate(pod, bottom + 0.002, top + 0.010))
        stripe = pod.buffer(0.0008).intersection(shapely.box(0.12, -1.0, 0.15, 1.0))
        builder.add("white", plate(stripe, bottom + 0.008, top + 0.0106))
    nose = _along((deck_end + 0.006, 0.0, deck), (x1 - 0.028, 0.0, top + 0.009), 0.052, 0.0028)
    builder.add("shell", nose)


def _add_drive(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Motor, shaft between the axles, differentials, speed controller and battery, below the deck."""
    floor = span(spec.platforms[0])[0] + FLOOR
    front, n = spec.wheelbase, builder.around(0.45)
    builder.add("steel", cylinder(0.0030, front - 0.04, (0.5 * front, 0.0, floor + 0.012), "x", n=builder.around(0.2)))
    for x in (0.0, front):
        builder.add("black", box((0.040, 0.034, 0.030), (x, 0.0, floor + 0.015), 0.005 if builder.n > 30 else 0.0))
        builder.add("steel", cylinder(0.0034, spec.track - 0.05, (x, 0.0, 0.0), "y", n=builder.around(0.2)))
    builder.add("aluminium", cylinder(0.0180, 0.046, (0.060, -0.030, floor + 0.019), "y", n))
    builder.add("spring", cylinder(0.0182, 0.006, (0.060, -0.014, floor + 0.019), "y", n))
    if builder.has_small_parts:
        for angle in np.linspace(0.0, 2.0 * math.pi, 10, endpoint=False):
            fin = box((0.0016, 0.034, 0.0020), (0.0, 0.0, 0.0185))
            fin = rotated(fin, float(angle), (0.0, 1.0, 0.0))
            fin.apply_translation((0.060, -0.034, floor + 0.019))
            builder.add("black", fin)
        for y in (-0.004, 0.0, 0.004):
            way = [(0.062, -0.008 + y, floor + 0.020), (0.078, 0.006 + y, floor + 0.026), (0.094, y, floor + 0.018)]
            builder.add("wire_orange", wire(way, 0.0016, 6, 5))
    builder.add("battery", box((0.120, 0.044, 0.025), (0.170, -0.022, floor + 0.013), 0.003 if n > 12 else 0.0))
    builder.add("strap", box((0.014, 0.046, 0.0265), (0.140, -0.022, floor + 0.0133)))
    builder.add("strap", box((0.014, 0.046, 0.0265), (0.205, -0.022, floor + 0.0133)))
    builder.add("matt_black", box((0.070, 0.036, 0.018), (0.150, 0.026, floor + 0.009)))
    for fin in np.linspace(-0.015, 0.015, 7 if builder.has_small_parts else 0):
        builder.add("aluminium", box((0.060, 0.0018, 0.006), (0.150, 0.026 + float(fin), floor + 0.021)))


def _add_suspension(builder: MeshBuilder, spec: VehicleSpec, x: float) -> None:
    """Shock tower, arms and spring dampers of an axle."""
    floor = span(spec.platforms[0])[0] + FLOOR
    is_front = x > 0.0
    ahead = 0.010 if spec.look == "enclosed" else 0.016  # the dampers stay inside the face of the enclosure
    tower = x + (ahead if is_front else -0.022)
    high = 0.046
    shape = shapely.Polygon([(-0.040, floor), (0.040, floor), (0.048, high - 0.006), (0.030, high), (-0.030, high)])
    shape = shapely.union_all([shape, shapely.Polygon([(-0.048, high - 0.006), (-0.030, high), (-0.040, floor)])])
    if builder.has_small_parts:
        shape = shape.difference(shapely.Point(0.0, floor + 0.028).buffer(0.013, quad_segs=8))
        for y in (-0.036, 0.036):
            shape = shape.difference(shapely.Point(y, high - 0.008).buffer(0.0018, quad_segs=3))
    mesh = plate(shape, -0.0018, 0.0018)
    mesh.apply_transform(np.array([[0, 0, 1, tower], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float))
    builder.add("carbon", mesh)
    hub = 0.5 * spec.track - 0.5 * spec.wheels.width
    # what a turned wheel leaves free beside its axle
    lock = float(ackermann_angle(spec.steering.largest_angle, spec.wheelbase, 0.5 * spec.track)) if is_front else 0.0
    inner = 0.5 * spec.track - 0.5 * spec.wheels.width - 0.35 * spec.wheels.radius * math.sin(lock) - 0.006
    for side in (-1.0, 1.0):
        for z, width in ((floor + 0.004, 0.026), (0.014, 0.012)):
            arm = shapely.Polygon(
                [(x - width, side * 0.020), (x + width, side * 0.020), (x + 0.005, side * hub), (x - 0.005, side * hub)]
            )
            if builder.has_small_parts and width > 0.02:
                hole = [(x - 0.4 * width, side * 0.030), (x + 0.4 * width, side * 0.030), (x, side * (hub - 0.022))]
                arm = arm.difference(shapely.Polygon(hole))
            builder.add("black", plate(arm, z, z + 0.0035))
        top, low = (tower, side * 0.040, high - 0.006), (x + 0.6 * (tower - x), side * inner, floor + 0.009)
        builder.add("steel", wire([top, low], 0.0022, builder.around(0.15), 1))
        a, b = _between(top, low, 0.12), _between(top, low, 0.55)
        builder.add("aluminium", wire([a, b], 0.0056, builder.around(0.25), 1))
        if builder.has_small_parts:
            builder.add("spring", wire(_helix(_between(top, low, 0.20), _between(top, low, 0.92)), 0.0009, 5, 2))
        else:
            builder.add("spring", wire([_between(top, low, 0.5), _between(top, low, 0.92)], 0.0066, 6, 1))


def _add_deck(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The deck, in the colour of the car, on standoffs."""
    x0, x1, _, y1 = edges(spec.platforms[1])
    bottom, top = span(spec.platforms[1])
    narrow, neck = 0.036, spec.wheelbase - spec.wheels.radius - 0.018
    half = [(x0, 0.6 * y1), (x0 + 0.018, y1), (neck - 0.03, y1), (neck + 0.012, narrow), (x1, narrow - 0.008)]
    outline = shapely.Polygon(half + [(x, -y) for x, y in reversed(half)])
    outline = outline.buffer(-0.003).buffer(0.003, quad_segs=max(2, builder.n // 12))
    if builder.has_small_parts:
        slots = [
            shapely.LineString([(x, side * 0.057), (x + 0.030, side * 0.057)]).buffer(0.0035, quad_segs=4)
            for x in (0.030, 0.085, 0.140, 0.195)
            for side in (-1.0, 1.0)
        ]
        outline = outline.difference(shapely.union_all(slots))
    builder.add("shell", plate(outline, bottom, top))
    floor = span(spec.platforms[0])[0] + FLOOR
    half_floor = 0.78 * edges(spec.platforms[0])[3]
    for x in (0.092, neck - 0.042):
        for side in (-1.0, 1.0):
            y = side * half_floor
            builder.add("brass", cylinder(0.0032, bottom - floor, (x, y, 0.5 * (bottom + floor)), n=6))
            if builder.has_small_parts:
                builder.add("steel", cylinder(0.0030, 0.0022, (x, y, top + 0.0011), n=10))


def _add_computer(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """A Jetson with heat sink and fan, and the power board behind it."""
    floor = span(spec.platforms[1])[1]
    x, z = 0.135, floor + 0.004
    builder.add("board_green", box((0.100, 0.080, 0.0016), (x, 0.0, z)))
    builder.add("matt_black", box((0.060, 0.056, 0.006), (x + 0.004, 0.0, z + 0.005)))
    for fin in np.linspace(-0.026, 0.026, 13 if builder.has_small_parts else 5):
        builder.add("matt_black", box((0.060, 0.0014, 0.010), (x + 0.004, float(fin), z + 0.012)))
    n = builder.around(0.5)
    ring = [(0.0165, 0.0), (0.0200, 0.0), (0.0200, 0.007), (0.0165, 0.007), (0.0165, 0.0)]
    builder.add("black", lathe(ring, (x + 0.004, 0.0, z + 0.017), n=n))
    builder.add("black", cylinder(0.0070, 0.006, (x + 0.004, 0.0, z + 0.020), n=n))
    for k in range(7 if builder.has_small_parts else 0):
        blade = rotated(box((0.0100, 0.0052, 0.0008), (0.0115, 0.0, 0.0)), 0.5, (1.0, 0.0, 0.0))
        blade = rotated(blade, 2.0 * math.pi * k / 7, (0.0, 0.0, 1.0))
        blade.apply_translation((x + 0.004, 0.0, z + 0.020))
        builder.add("black", blade)
    for y, width in ((-0.030, 0.016), (-0.010, 0.014), (0.010, 0.014), (0.029, 0.012)):
        builder.add("aluminium", box((0.016, width, 0.013), (x - 0.044, y, z + 0.0073)))
    builder.add("board_green", box((0.055, 0.070, 0.0016), (0.045, 0.0, z)))
    for y in (-0.022, 0.0, 0.022):
        builder.add("black", cylinder(0.0048, 0.012, (0.034, y, z + 0.0068), n=builder.around(0.35)))
        builder.add("wire_orange", box((0.010, 0.014, 0.009), (0.060, y, z + 0.0053)))
    for side in (-1.0, 1.0):  # antennas, behind the camera
        foot, tip = (0.002, side * 0.062, floor), (-0.010, side * 0.074, floor + 0.085)
        builder.add("black", wire([foot, _between(foot, tip, 0.25)], 0.0042, builder.around(0.2), 1))
        builder.add("black", wire([_between(foot, tip, 0.25), tip], 0.0030, builder.around(0.15), 1))


def _add_enclosure(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """A shell with a sloped face and back, its lower edge, windows, fan and display."""
    x0, x1, y0, y1 = edges(spec.platforms[1])
    bottom, top = span(spec.platforms[1])
    low = bottom + 0.5 * (top - bottom)
    side = [(x0, bottom), (x1, bottom), (x1, low), (x1 - 0.10, top), (x0 + 0.03, top), (x0, top - 0.02)]
    outline = shapely.Polygon(side).buffer(-0.005).buffer(0.005, quad_segs=max(2, builder.n // 12))
    builder.add("shell", _upright(outline, y0, y1))
    builder.add("matt_black", box((x1 - x0 + 0.002, y1 - y0 + 0.002, 0.006), (0.5 * (x0 + x1), 0.0, bottom + 0.003)))
    window = shapely.Polygon([(x0 + 0.05, low), (x1 - 0.05, low), (x1 - 0.105, top - 0.01), (x0 + 0.06, top - 0.01)])
    window = window.buffer(-0.003).buffer(0.003, quad_segs=max(1, builder.n // 18))
    builder.add("glass", _upright(window, y0 - 0.0006, y1 + 0.0006))
    stripe = shapely.box(x0 + 0.030, top - 0.001, x1 - 0.102, top + 0.0005)
    for y in (-0.045, 0.045):
        builder.add("white", _upright(stripe, y - 0.005, y + 0.005))
    n, fan = builder.around(0.5), (x0 + 0.055, 0.0, top)
    ring = [(0.0165, 0.0), (0.0195, 0.0), (0.0195, 0.004), (0.0165, 0.004), (0.0165, 0.0)]
    builder.add("black", lathe(ring, fan, n=n), cylinder(0.0168, 0.001, fan, n=n), cylinder(0.0060, 0.006, fan, n=n))
    builder.add("glass", box((0.0012, 0.064, 0.016), (x0, 0.0, top - 0.036)))  # display
    if builder.has_small_parts:
        for angle in np.linspace(0.0, 2.0 * math.pi, 7, endpoint=False):
            blade = rotated(box((0.0095, 0.0052, 0.0008), (0.0105, 0.0, 0.0)), 0.5, (1.0, 0.0, 0.0))
            blade = rotated(blade, float(angle), (0.0, 0.0, 1.0))
            blade.apply_translation((fan[0], fan[1], fan[2] + 0.002))
            builder.add("black", blade)
        for x in np.linspace(x1 - 0.085, x1 - 0.035, 6):  # louvres on the face
            z = low + (top - low) * (x1 - float(x)) / 0.10
            builder.add("black", box((0.003, 0.056, 0.0016), (float(x), 0.0, z)))


def _add_wing(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The wing behind the enclosure, on two mounts."""
    x = edges(spec.platforms[0])[0] + 0.025
    low, top = span(spec.platforms[0])[1], span(spec.platforms[1])[1] - 0.004
    half = 0.5 * spec.track
    section = shapely.Polygon(
        [(x - 0.022, top + 0.006), (x - 0.019, top + 0.009), (x + 0.022, top), (x + 0.022, top - 0.003)]
    )
    builder.add("matt_black", _upright(section, -half, half))  # a glossy plate shows the sky: it looks white
    mount = shapely.Polygon([(x - 0.004, low), (x + 0.016, low), (x + 0.012, top), (x - 0.008, top + 0.003)])
    end = shapely.Polygon(
        [(x - 0.028, top - 0.014), (x + 0.024, top - 0.014), (x + 0.024, top + 0.006), (x - 0.028, top + 0.014)]
    )
    for side in (-1.0, 1.0):
        builder.add("aluminium", _upright(mount, 0.030 * side - 0.0012, 0.030 * side + 0.0012))
        builder.add("shell", _upright(end, half * side - 0.0015, half * side + 0.0015))


def _add_lidar_base(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """The base of the LIDAR, a Hokuyo UST-10LX on a deck; its window is the node `lidar_head`."""
    lidar = spec.sensors.lidar
    if lidar is None:
        return
    x, y, z = lidar.mount.position
    floor, top = span(spec.platforms[1])[1], z - 0.0155
    builder.add("aluminium", box((LIDAR_SIZE + 0.006, LIDAR_SIZE + 0.006, 0.003), (x, y, floor + 0.0015)))
    height = top - floor - 0.003
    body = box((LIDAR_SIZE, LIDAR_SIZE, height), (x, y, top - 0.5 * height), 0.006, builder.around(0.08))
    builder.add("black", body)
    builder.add("wire_orange", box((0.0008, 0.030, 0.006), (x + 0.5 * LIDAR_SIZE, y, floor + 0.5 * height)))
    if builder.has_small_parts:
        back = x - 0.5 * LIDAR_SIZE
        way = [(back, 0.006, floor + 0.010), (back - 0.014, 0.012, floor + 0.012), (back - 0.030, 0.022, floor + 0.008)]
        builder.add("black", wire(way, 0.0024, 8, 6))


def _add_cameras(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Each camera in its housing: on two struts from the deck, or in the face of the enclosure."""
    floor, is_enclosed = span(spec.platforms[1])[1], spec.look == "enclosed"
    width, lenses = (0.044, (0.0,)) if is_enclosed else (0.088, (-0.030, 0.0, 0.022))
    for camera in spec.cameras.values():
        mount, (x, y, z) = camera.mount, camera.mount.position
        housing = box((0.022, width, 0.024), (-0.0125, 0.0, 0.0), 0.006 if builder.n > 30 else 0.0)
        builder.add_mounted("aluminium", mount, housing, back=0.002)
        builder.add_mounted("glass", mount, box((0.0012, width - 0.010, 0.016), (-0.0012, 0.0, 0.0)), back=0.002)
        for side in lenses:
            lens = cylinder(0.0045, 0.0012, (-0.0006, side, 0.0), "x", builder.around(0.3))
            builder.add_mounted("lens_glass", mount, lens, back=0.002)
        for side in () if is_enclosed else (-0.024, 0.024):
            foot, head = (x + 0.006, y + side, floor), (x - 0.014, y + side, z - 0.008)
            builder.add("carbon", wire([foot, head], 0.0038, builder.around(0.2), 1))
            builder.add("aluminium", cylinder(0.0065, 0.004, (foot[0], foot[1], floor + 0.002), n=builder.around(0.3)))


def _upright(outline: shapely.Polygon, y0: float, y1: float) -> trimesh.Trimesh:
    """An outline in x and z, extruded along y between two places [m]."""
    mesh = plate(outline, -y1, -y0)
    mesh.apply_transform(np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float))
    return mesh


def _between(a: Vector, b: Vector, share: float) -> Vector:
    """The point at that share of the way from a to b."""
    x, y, z = (start + share * (end - start) for start, end in zip(a, b, strict=True))
    return x, y, z


def _along(a: Vector, b: Vector, width: float, thickness: float) -> trimesh.Trimesh:
    """A board of that width from a to b, which are in a plane of constant y."""
    length, angle = math.hypot(b[0] - a[0], b[2] - a[2]), math.atan2(a[2] - b[2], b[0] - a[0])
    board = rotated(box((length, width, thickness)), angle, (0.0, 1.0, 0.0))
    board.apply_translation(_between(a, b, 0.5))
    return board


def _helix(a: Vector, b: Vector, radius: float = 0.0066, turns: int = 6) -> Sequence[Vector]:
    """Points of a coil spring from a to b [m]."""
    start, end = np.array(a), np.array(b)
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, (1.0, 0.0, 0.0))
    across /= np.linalg.norm(across)
    third = np.cross(axis, across)
    points = []
    for t in np.linspace(0.0, 1.0, 8 * turns + 1).tolist():
        angle = 2.0 * math.pi * turns * t
        x, y, z = start + t * (end - start) + radius * (math.cos(angle) * across + math.sin(angle) * third)
        points.append((float(x), float(y), float(z)))
    return points
