"""Contact of one wheel with what is below it: suspension ray or edge, contact velocity and axes, normal load."""

from __future__ import annotations

from math import sqrt

from autodrive.base.arrays import Floats
from autodrive.base.elementary import cos, sin
from autodrive.base.jit import inlined
from autodrive.base.transforms import Rotation, Vector
from autodrive.physics.buffers import Scratch
from autodrive.physics.formulas import suspension_force
from autodrive.physics.free_body import velocity_at
from autodrive.physics.model import BOX, Model
from autodrive.physics.ray import MISS, cast_ray
from autodrive.physics.state import State
from autodrive.physics.wheel_edge import CLIMBABLE, edge_support

ON_ITS_SIDE = 0.1
"""Cosine of the inclination beyond which a vehicle lies on the rims of its wheels: its suspension carries nothing."""


@inlined
def find_contact(
    i: int, w: int, angle: float, rotation: Rotation, turn: Vector, model: Model, state: State, scratch: Scratch
) -> None:
    """Finds the ground below wheel w of vehicle i, steered by `angle` [rad], and fills its contact row.

    The ground is where the suspension ray hits, as in PhysX, or an edge of a box that the circle of the wheel reaches
    before. `rotation` and `turn`: of the vehicle, angular velocity [rad/s] in map axes. Also sets the wheel's
    compression and normal load in the state. The spin columns of the row are not written.
    """
    v = model.vehicles[i]
    wheel = model.wheels[4 * i + w]
    row = 4 * i + w
    contact = scratch.wheel_contacts[w]
    qpos, dof = v["qpos"], v["dof"]
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation
    ox, oy, oz = state.qpos[qpos], state.qpos[qpos + 1], state.qpos[qpos + 2]
    hub = wheel["hub"]
    # The suspension ray goes down the body's z axis. It starts a radius above the hub of the fully compressed wheel, so
    # that it begins above all ground that the wheel can stand on, and `distance` - `start` is how far below the hub the
    # ground is. The hub, relative to the origin of the vehicle frame, and the start of the ray, in map axes:
    hx = r00 * hub[0] + r01 * hub[1] + r02 * hub[2]
    hy = r10 * hub[0] + r11 * hub[1] + r12 * hub[2]
    hz = r20 * hub[0] + r21 * hub[1] + r22 * hub[2]
    radius, high, low = wheel["radius"], wheel["compression_max"], wheel["droop_max"]
    start = radius + high
    px, py, pz = ox + hx + r02 * start, oy + hy + r12 * start, oz + hz + r22 * start
    # heading of the wheel: the vehicle's x axis turned by the steering angle in the plane of body axes x and y
    cosine, sine = cos(angle), sin(angle)
    ex, ey, ez = cosine * r00 + sine * r01, cosine * r10 + sine * r11, cosine * r20 + sine * r21
    # First candidate for the ground: the floor z = 0. The shapes below may be nearer.
    distance, nx, ny, nz, shape = MISS, 0.0, 0.0, 1.0, -1
    if r22 > ON_ITS_SIDE:
        distance = pz / r22
    # what is higher than the wheel can climb, such as a box on top of it, is an obstacle for its collider
    nearest = start + radius - max(high, (1.0 - CLIMBABLE) * radius)
    # `edge`: the compression with which the circle of the wheel stands on the highest edge of a box
    edge, edge_ahead, edge_shape = -MISS, 0.0, -1
    for j in range(scratch.nearby_count[i]):
        s = scratch.nearby[i, j]
        if model.shapes.vehicle[s] >= 0:
            continue  # a car is no ground but an obstacle: it may come under a wheel from the side, with a step
        # Leave out what is farther than the ray and the wheel reach, by the sphere around the shape.
        centre = state.shape_position[s]
        cx, cy, cz = centre[0] - px, centre[1] - py, centre[2] - pz
        far = 2.0 * radius + high + low + model.shapes.bounding_radius[s]
        if cx * cx + cy * cy + cz * cz > far * far:
            continue
        if model.shapes.kind[s] == BOX:
            # Leave out a box that no wheel at this hub can touch; otherwise, the circle of the wheel may stand on an
            # edge of it, before or behind the ray.
            size, m = model.shapes.size[s], state.shape_rotation[s]
            hub_in_box = _in_box(m, -cx - r02 * start, -cy - r12 * start, -cz - r22 * start)
            reach = radius + max(high, low)
            if (
                abs(hub_in_box[0]) > size[0] + reach
                or abs(hub_in_box[1]) > size[1] + reach
                or abs(hub_in_box[2]) > size[2] + reach
            ):
                continue
            highest, at = edge_support(size, hub_in_box, _in_box(m, ex, ey, ez), _in_box(m, r02, r12, r22), radius)
            if highest > edge:
                edge, edge_ahead, edge_shape = highest, at, s
        # The ray may hit the shape; the nearest hit that the wheel can climb is the ground.
        t, sx, sy, sz = cast_ray(
            int(model.shapes.kind[s]),
            model.shapes.size[s],
            centre,
            state.shape_rotation[s],
            px,
            py,
            pz,
            -r02,
            -r12,
            -r22,
        )
        if nearest <= t < distance:
            distance, nx, ny, nz, shape = t, sx, sy, sz, s
    # The hit of the ray gives the compression, unless the wheel is held up higher by an edge.
    compression = radius - (distance - start)
    # the contact is `ahead` of the axle and, at compression 0, `below` it
    ahead, below = 0.0, radius
    is_on_edge = edge > compression
    lean, rise = 0.0, 1.0
    if is_on_edge:  # its normal points to the axle
        compression, ahead, shape = edge, edge_ahead, edge_shape
        below = sqrt(radius * radius - ahead * ahead)
        lean, rise = -ahead / radius, below / radius
        nx, ny, nz = lean * ex + rise * r02, lean * ey + rise * r12, lean * ez + rise * r22
    # Without ground in reach of the suspension the wheel hangs down; a vehicle on its side may lie on its rim.
    upright = nx * r02 + ny * r12 + nz * r22  # cosine of the angle between the normal and the suspension
    if compression <= -low or upright <= ON_ITS_SIDE:
        contact["is_airborne"] = True
        contact["load"] = 0.0
        contact["longitudinal_velocity"] = 0.0
        contact["lateral_velocity"] = 0.0
        state.wheel_compression[row] = -low
        state.wheel_normal_load[row] = 0.0
        if r22 <= ON_ITS_SIDE:
            _lie_on_rim(i, w, rotation, turn, hx, hy, hz, model, state, scratch)
        return
    # contact point, relative to the origin of the vehicle frame; its velocity relative to the body it stands on
    down = below - compression
    kx, ky, kz = hx + ex * ahead - r02 * down, hy + ey * ahead - r12 * down, hz + ez * ahead - r22 * down
    wx, wy, wz = turn
    vx = state.qvel[dof] + wy * kz - wz * ky
    vy = state.qvel[dof + 1] + wz * kx - wx * kz
    vz = state.qvel[dof + 2] + wx * ky - wy * kx
    if shape >= 0 and model.shapes.dof[shape] >= 0:
        gx, gy, gz = velocity_at(state, model.shapes.qpos[shape], model.shapes.dof[shape], ox + kx, oy + ky, oz + kz)
        vx, vy, vz = vx - gx, vy - gy, vz - gz
    # The wheel stays on the plane of the ground: the speed of compression is the speed along the normal, divided by
    # `upright`. The suspension turns compression and speed into the load.
    speed = -(nx * vx + ny * vy + nz * vz) / upright
    load = suspension_force(
        compression,
        speed,
        wheel["sprung_mass"] * model.gravity * max(0.0, r22),
        wheel["stiffness"],
        wheel["damping"],
        high,
        wheel["bump_stiffness"],
        wheel["look_ahead"],
    )
    # Axes of the contact plane: longitudinal l and lateral t. On an edge, l is the tangent of the circle of the wheel.
    if is_on_edge:
        load /= upright  # the part along the suspension carries the load: no energy is gained or lost
        lx, ly, lz = rise * ex - lean * r02, rise * ey - lean * r12, rise * ez - lean * r22
        tx, ty, tz = ny * lz - nz * ly, nz * lx - nx * lz, nx * ly - ny * lx
        # the axle moves over the edge with the suspension
        vx, vy, vz = vx + speed * r02, vy + speed * r12, vz + speed * r22
    else:
        load *= upright  # PhysX
        # the vehicle's x axis projected onto the contact plane, turned by the steering angle about the normal
        along = r00 * nx + r10 * ny + r20 * nz
        fx, fy, fz = r00 - along * nx, r10 - along * ny, r20 - along * nz
        length = sqrt(fx * fx + fy * fy + fz * fz)
        fx, fy, fz = fx / length, fy / length, fz / length
        sx, sy, sz = ny * fz - nz * fy, nz * fx - nx * fz, nx * fy - ny * fx
        lx, ly, lz = cosine * fx + sine * sx, cosine * fy + sine * sy, cosine * fz + sine * sz
        tx, ty, tz = cosine * sx - sine * fx, cosine * sy - sine * fy, cosine * sz - sine * fz
    # The forces act `force_height` above the contact point: `base` is how far that is below the hub at compression 0.
    base = below - wheel["force_height"]
    contact["is_airborne"] = False
    contact["shape"] = shape
    contact["load"] = load
    contact["longitudinal_velocity"] = vx * lx + vy * ly + vz * lz
    contact["lateral_velocity"] = vx * tx + vy * ty + vz * tz
    longitudinal, lateral, normal = contact["longitudinal_axis"], contact["lateral_axis"], contact["normal"]
    longitudinal[0], longitudinal[1], longitudinal[2] = lx, ly, lz
    lateral[0], lateral[1], lateral[2] = tx, ty, tz
    normal[0], normal[1], normal[2] = nx, ny, nz
    arm, point = contact["lever_arm"], contact["point"]
    arm[0], arm[1], arm[2] = hx + ex * ahead - r02 * base, hy + ey * ahead - r12 * base, hz + ez * ahead - r22 * base
    point[0], point[1], point[2] = ox + kx, oy + ky, oz + kz
    state.wheel_compression[row] = compression
    state.wheel_normal_load[row] = load


@inlined
def _lie_on_rim(
    i: int,
    w: int,
    rotation: Rotation,
    turn: Vector,
    hx: float,
    hy: float,
    hz: float,
    model: Model,
    state: State,
    scratch: Scratch,
) -> None:
    """Lets the stop of a fully compressed wheel carry a vehicle that lies on its side or its back on the floor.

    hx, hy, hz: hub, relative to the origin of the vehicle frame, map axes. Fills the contact row if the wheel, a circle
    at full compression, is below the floor and the floor pushes it.
    """
    v = model.vehicles[i]
    wheel = model.wheels[4 * i + w]
    qpos, dof = v["qpos"], v["dof"]
    r00, _, r02, r10, _, r12, _, _, r22 = rotation
    radius, high, stiffness = wheel["radius"], wheel["compression_max"], wheel["bump_stiffness"]
    damping = sqrt(stiffness * wheel["sprung_mass"])
    wx, wy, wz = turn
    # The bump stop carries both ends of the diameter along the vehicle's z axis, each as a spring with a damper: a rim
    # that is nearly flat on the floor stands on both. `arm`: from the hub along that axis.
    load, moment = 0.0, 0.0
    for arm in (high - radius, high + radius):
        kx, ky, kz = hx + arm * r02, hy + arm * r12, hz + arm * r22
        depth = -(state.qpos[qpos + 2] + kz)
        if depth > 0.0:
            force = max(0.0, stiffness * depth - damping * (state.qvel[dof + 2] + wx * ky - wy * kx))
            load += force
            moment += force * arm
    if load == 0.0:
        return
    # both forces act as one at their centre k, relative to the origin of the vehicle frame, which moves with v
    arm = moment / load
    kx, ky, kz = hx + arm * r02, hy + arm * r12, hz + arm * r22
    vx = state.qvel[dof] + wy * kz - wz * ky
    vy = state.qvel[dof + 1] + wz * kx - wx * kz
    # the longitudinal axis is the vehicle's x axis on the floor; the x axis of the map if that one is nearly vertical
    length = sqrt(r00 * r00 + r10 * r10)
    fx, fy = 1.0, 0.0
    if length > 0.1:
        fx, fy = r00 / length, r10 / length
    contact = scratch.wheel_contacts[w]
    contact["is_airborne"] = False
    contact["shape"] = -1
    contact["load"] = load
    contact["longitudinal_velocity"] = vx * fx + vy * fy
    contact["lateral_velocity"] = vy * fx - vx * fy
    longitudinal, lateral, normal = contact["longitudinal_axis"], contact["lateral_axis"], contact["normal"]
    longitudinal[0], longitudinal[1], longitudinal[2] = fx, fy, 0.0
    lateral[0], lateral[1], lateral[2] = -fy, fx, 0.0
    normal[0], normal[1], normal[2] = 0.0, 0.0, 1.0
    lever = contact["lever_arm"]
    lever[0], lever[1], lever[2] = kx, ky, kz
    state.wheel_compression[4 * i + w] = high
    state.wheel_normal_load[4 * i + w] = load


@inlined
def _in_box(m: Floats, x: float, y: float, z: float) -> Vector:
    """A vector in the axes of a box with the rotation matrix `m` (map from box, row-major, shape (9,))."""
    return m[0] * x + m[3] * y + m[6] * z, m[1] * x + m[4] * y + m[7] * z, m[2] * x + m[5] * y + m[8] * z
