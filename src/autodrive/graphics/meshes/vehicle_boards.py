"""Parts on the upper platforms: computer, boards, wires, LIDAR and cameras."""

from __future__ import annotations

import itertools
import math

import numpy as np
import shapely

from autodrive.base.units import DEGREE
from autodrive.graphics.meshes.mesh_builder import MeshBuilder
from autodrive.graphics.meshes.solids import box, cylinder, lathe, plate, rotated, wire
from autodrive.graphics.meshes.vehicle_chassis import BATTERY_SIZE, BATTERY_X, edges, span
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.scenario.vehicles.spec import VehicleSpec

HEAD = -0.0215, 0.0165
"""Bottom and top of the rotating head of the LIDAR, relative to its scan plane [m]."""
HEAD_RADIUS = 0.035


def add_computer(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """A Jetson Nano B01 (100 x 80 mm, sockets to the rear) and the microcontroller board."""
    floor = span(spec.platforms[2])[1]
    x, z = edges(spec.platforms[2])[0] + 0.062, floor + 0.0055
    builder.add("board_green", box((0.080, 0.100, 0.0016), (x, 0.0, z)))
    builder.add("board_green", box((0.045, 0.070, 0.0012), (x + 0.008, 0.0, z + 0.0055)))
    builder.add("matt_black", box((0.038, 0.058, 0.003), (x + 0.008, 0.0, z + 0.0076)))
    for fin in np.linspace(-0.0275, 0.0275, 14 if builder.has_small_parts else 5):
        builder.add("matt_black", box((0.038, 0.0013, 0.0095), (x + 0.008, float(fin), z + 0.0138)))
    sockets = ((0.0160, 0.0215), (0.0150, -0.0005), (0.0150, -0.0195), (0.0115, -0.0380))
    for width, y in sockets:
        builder.add("aluminium", box((0.0175, width, 0.0135), (x - 0.0335, y, z + 0.0076)))
        if builder.has_small_parts:
            builder.add("black", box((0.0006, width - 0.003, 0.0100), (x - 0.0424, y, z + 0.0076)))
    builder.add("black", box((0.011, 0.009, 0.010), (x - 0.034, 0.040, z + 0.006)))
    builder.add("black", box((0.0508, 0.0050, 0.0024), (x + 0.006, 0.0440, z + 0.002)))
    if builder.has_small_parts:
        for i, y in itertools.product(range(20), (0.0427, 0.0453)):
            builder.add("brass", box((0.0007, 0.0007, 0.0075), (x - 0.0182 + 0.00254 * i, y, z + 0.0066)))
        for dx, y in itertools.product((-0.036, 0.036), (-0.046, 0.046)):
            builder.add("steel", cylinder(0.0026, 0.0030, (x + dx, y, z + 0.0012), n=8))
    x += 0.096
    builder.add("board_blue", box((0.076, 0.088, 0.0016), (x, 0.0, z)))
    builder.add("board_blue", box((0.0180, 0.0432, 0.0014), (x + 0.018, 0.012, z + 0.0100)))
    builder.add("black", box((0.0070, 0.0070, 0.0012), (x + 0.018, 0.010, z + 0.0113)))
    builder.add("aluminium", box((0.0076, 0.0090, 0.0038), (x + 0.018, 0.0320, z + 0.0120)))
    for row in (-0.0076, 0.0076):
        builder.add("black", box((0.0025, 0.0400, 0.0085), (x + 0.018 + row, 0.012, z + 0.0050)))
    for y in (-0.030, -0.020):
        builder.add("board_green", box((0.0220, 0.0080, 0.0100), (x + 0.016, y, z + 0.0058)))
        for screw in np.linspace(-0.008, 0.008, 4 if builder.has_small_parts else 0):
            builder.add("steel", cylinder(0.0018, 0.0006, (x + 0.016 + float(screw), y, z + 0.0109), n=8))
    for i, y in enumerate((-0.036, -0.030, 0.030, 0.036)):
        builder.add("black", cylinder(0.0032, 0.0110, (x - 0.028 + 0.001 * i, y, z + 0.0062), n=builder.around(0.35)))
    mount = spec.sensors.imu.mount.position
    if mount[2] > floor:
        builder.add("board_blue", box((0.0155, 0.0255, 0.0014), (mount[0], mount[1], floor + 0.0190)))


def add_wires(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """Battery cables, motor cables and the USB cable of the LIDAR."""
    low, second, third, fourth = (span(platform) for platform in spec.platforms[:4])
    y2, y3 = edges(spec.platforms[1])[3], edges(spec.platforms[2])[3]
    back = BATTERY_X - 0.5 * BATTERY_SIZE[0]
    for d, material in ((0.0, "wire_red"), (0.004, "black")):
        way = [(back + 0.002, 0.004 + d, second[1] + 0.013), (back - 0.014, 0.007 + d, second[1] + 0.013)]
        way += [(-0.052, y2 - 0.004 + d, second[1] + 0.024), (-0.046, y3 - 0.016 + d, third[0] - 0.006)]
        way += [(-0.034, y3 - 0.012, third[1] + 0.006 + d), (-0.008, y3 - 0.020, third[1] + 0.007 + d)]
        builder.add(material, wire(way, 0.0014, 6, 5))
        for side in (-1.0, 1.0):
            way = [(0.071, side * (0.046 + d), 0.002), (0.083, side * (0.040 + d), 0.010)]
            way += [(0.080, side * 0.030, low[1] + 0.014), (0.068, side * (0.014 + d), low[1] + 0.010)]
            builder.add(material, wire(way, 0.0011, 5, 4))
    x = edges(spec.platforms[3])[0]
    way = [(-0.036, -0.024, third[1] + 0.011), (x - 0.020, -0.026, third[1] + 0.012)]
    way += [(x - 0.018, -0.034, fourth[1] + 0.002), (x + 0.012, -0.040, fourth[1] + 0.004)]
    builder.add("matt_black", wire([*way, (x + 0.034, -0.034, fourth[1] + 0.004)], 0.0017, 6, 5))


def add_lidar(builder: MeshBuilder, spec: VehicleSpec) -> None:
    """An RPLIDAR A1: base, motor and belt; its USB adapter beside it. The rotating head is the node `lidar_head`."""
    lidar = spec.sensors.lidar
    if lidar is None:
        return
    x, y, z = lidar.mount.position
    floor = span(spec.platforms[3])[1]
    base = max(floor + 0.006, z + HEAD[0] - 0.0145)
    for dx, dy in itertools.product((-0.022, 0.022), (-0.025, 0.025)):
        builder.add("brass", cylinder(0.0028, base - floor, (x + dx, y + dy, 0.5 * (base + floor)), n=6))
        if builder.has_small_parts:
            builder.add("steel", cylinder(0.0027, 0.0016, (x + dx, y + dy, base + 0.0048), n=10))
    quads = builder.around(0.25)
    head, motor = shapely.Point(x, y), shapely.Point(x - 0.044, y)
    deck = shapely.union_all([head.buffer(0.035, quads), motor.buffer(0.019, quads)]).convex_hull
    builder.add("black", plate(deck, base, base + 0.004))
    builder.add("matt_black", cylinder(0.0300, z + HEAD[0] - base, (x, y, 0.5 * (z + HEAD[0] + base)), n=builder.n))
    belt = shapely.union_all([head.buffer(0.0310, quads), motor.buffer(0.0052, quads)]).convex_hull
    builder.add("rubber", plate(belt, base + 0.0066, base + 0.0090))
    builder.add("steel", cylinder(0.0046, 0.0090, (x - 0.044, y, base + 0.0070), n=builder.around(0.3)))
    hang = min(0.020, 0.8 * (base - floor))
    builder.add("aluminium", cylinder(0.0120, hang, (x - 0.044, y, base - 0.5 * hang), n=builder.around(0.5)))
    board = edges(spec.platforms[3])[0] + 0.045
    builder.add("board_blue", box((0.034, 0.020, 0.0014), (board, -0.034, floor + 0.004)))
    builder.add("aluminium", box((0.0060, 0.0080, 0.0030), (board - 0.014, -0.034, floor + 0.006)))
    builder.add("black", box((0.0060, 0.0060, 0.0012), (board + 0.004, -0.034, floor + 0.0053)))


def add_lidar_head(builder: MeshBuilder) -> None:
    """The rotating head, around the origin of the LIDAR."""
    (low, high), n = HEAD, builder.n
    disc = shapely.Point(0.0, 0.0).buffer(HEAD_RADIUS, builder.around(0.25))
    face = 0.0300  # distance of the flat front face
    builder.add("black", plate(disc.intersection(shapely.box(-1.0, -1.0, face, 1.0)), low + 0.004, high - 0.006))
    foot = [(0.0, low), (HEAD_RADIUS - 0.002, low), (HEAD_RADIUS, low + 0.0015), (HEAD_RADIUS, low + 0.004)]
    builder.add("black", lathe([*foot, (0.0, low + 0.004)], n=n))
    edge = [(HEAD_RADIUS, high - 0.006), (HEAD_RADIUS, high - 0.003), (HEAD_RADIUS - 0.0009, high - 0.0009)]
    builder.add("black", lathe([(0.0, high - 0.006), *edge, (HEAD_RADIUS - 0.003, high), (0.0, high)], n=n))
    # transmitter and receiver, side by side
    for side, radius in ((-1.0, 0.0050), (1.0, 0.0066)):
        center = (face, side * 0.0095, 0.0)
        ring = [(0.0, 0.0), (radius + 0.0014, 0.0), (radius + 0.0012, 0.0020), (radius, 0.0020), (radius, 0.0008)]
        builder.add("matt_black", lathe([*ring, (0.0, 0.0008)], center, "x", builder.around(0.35)))
        glass = [(0.0, 0.0007), (radius, 0.0007), (0.6 * radius, 0.0014), (0.0, 0.0017)]
        builder.add("lens_glass", lathe(glass, center, "x", builder.around(0.35)))
    if builder.has_small_parts:
        mark = [(0.0150, high - 0.0001), (0.0165, high - 0.0001), (0.0165, high + 0.0003), (0.0150, high + 0.0003)]
        builder.add("white", lathe([*mark, mark[0]], n=n))


def add_camera(builder: MeshBuilder, camera: CameraSpec, spec: VehicleSpec) -> None:
    """A Raspberry Pi camera: its lens ends at the mount, so that it is not visible in its own image."""
    mount, (x, y, z) = camera.mount, camera.mount.position
    yaw = mount.rotation_deg[2] * DEGREE
    floor = span(spec.platforms[3])[1] if len(spec.platforms) > 3 else z - 0.01
    builder.add_mounted("black", mount, box((0.0040, 0.0085, 0.0085), (-0.0062, 0.0, 0.0)))
    builder.add_mounted("black", mount, cylinder(0.0034, 0.0042, (-0.0024, 0.0, 0.0), "x", builder.around(0.4)))
    builder.add_mounted("glass", mount, cylinder(0.0022, 0.0006, (-0.0004, 0.0, 0.0), "x", builder.around(0.3)))
    builder.add_mounted("board_green", mount, box((0.0012, 0.0250, 0.0240), (-0.0088, 0.0, 0.0045)))
    builder.add_mounted("acrylic", mount, box((0.0030, 0.0300, 0.0290), (-0.0118, 0.0, 0.0050)))
    for dy, dz in itertools.product((-0.0105, 0.0105), (-0.005, 0.0145)) if builder.has_small_parts else ():
        builder.add_mounted("steel", mount, cylinder(0.0018, 0.0012, (-0.0078, dy, dz), "x", 8))
    builder.add_mounted("white", mount, box((0.0024, 0.0200, 0.0040), (-0.0074, 0.0, 0.0142)))
    foot = rotated(box((0.022, 0.020, 0.0030), (-0.022, 0.0, 0.0)), yaw, (0.0, 0.0, 1.0))
    foot.apply_translation((x, y, floor + 0.0015))
    builder.add("acrylic", foot)
    c, s = math.cos(yaw), math.sin(yaw)
    ribbon = [(-0.0105, 0.013), (-0.020, 0.017), (-0.032, 0.010)]
    ribbon += [(-0.036, floor - z - 0.004), (-0.034, floor - z - 0.018)]
    for dy in np.linspace(-0.006, 0.006, 7 if builder.has_small_parts else 2):
        line = [(x + c * a - s * dy, y + s * a + c * dy, z + b) for a, b in ribbon]
        builder.add("ribbon", wire(line, 0.00075, 4, 4))
