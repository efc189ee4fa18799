"""What the drivers of the traffic do in a tick: follow their links, keep distance, wait at gates, give way.

Distance: the Intelligent Driver Model (Treiber, Hennecke, Helbing: Congested traffic states in empirical observations
and microscopic simulations, Physical Review E 62, 2000). Steering: the front axle follows the centre line (Hoffmann,
Tomlin, Montemerlo, Thrun: Autonomous automobile trajectory tracking for off-road driving, ACC 2007). Give way: gap
acceptance with the critical gaps of the Highway Capacity Manual, see `roads.CRITICAL_GAPS`.

Lengths, speeds and accelerations are those of real traffic divided by 14, the scale of the cars; times are as they are,
because the programs of the lights and the reactions of other drivers are in real time.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import Floats, Integers
from autodrive.base.elementary import atan, atan2
from autodrive.base.jit import inlined, jit_uncounted
from autodrive.physics.sensors.random_stream import uniform
from autodrive.scenario.maps.roads import Roads

SCALE = 14.0
# Treiber, Kesting: Traffic Flow Dynamics (2013), table 11.2, city traffic
HEADWAY = 1.0
"""Time gap T [s]."""
JAM_GAP = 2.0 / SCALE
"""Smallest gap between bumpers s0 [m]."""
ACCELERATION = 1.0 / SCALE
"""Maximum acceleration a [m/s^2]."""
BRAKING = 1.5 / SCALE
"""Comfortable deceleration b [m/s^2]."""
EXPONENT = 4
"""Exponent delta of the speed on a free road."""
YELLOW_BRAKING = 3.0 / SCALE
"""A driver who would brake harder for a yellow light drives on [m/s^2]; it is the usual value for its duration."""
SIDE_MARGIN = 0.05
"""Room between the bodies of two vehicles that pass each other [m]."""
STOP_MARGIN = 0.03
"""Distance from the front of a waiting vehicle to the stop line [m]."""
LINE_MARGIN = 0.01
"""Distance from the front of a vehicle to the stop line after hard braking [m]."""
LOOK = 2.0
"""A driver looks so far for vehicles ahead [m]."""
ASK = 1.6
"""A driver asks for a gate that is nearer than that [m]."""
AT_LINE = 0.4
"""A driver nearer than that waits at the gate, and others who would go later let it go first [m]."""
PATIENCE = 20.0
"""A driver who has waited so long at a gate no longer gives way to those who come later [s]."""
STOPPED = 0.03
"""A slower vehicle has stopped [m/s]."""
SIGNAL = 30.0 / SCALE
"""A driver indicates a turn that is nearer than that [m] (Uniform Vehicle Code, 11-804: 100 feet)."""
BRAKE_ON, BRAKE_OFF = 0.7 / SCALE, 0.35 / SCALE
"""The brake lamps go on above the first deceleration, below which they must be off (UN Regulation 13-H, 5.2.22.4), and
off below the second one [m/s^2]."""
LOST = 0.3
"""A vehicle farther from its link looks for another one [m]."""
STEERING_GAIN = 2.0
"""Gain k of the cross-track error [1/s] (Hoffmann, (5))."""
STEERING_SPEED = 0.2
"""Softens the steering at low speed [m/s]."""
UNREGULATED, RED, YELLOW, GREEN = 0, 1, 2, 3
"""What a driver sees of a traffic light."""
ROUTE = 3
"""Links of the route behind the present one."""
NONE = -1
BOX = -2
"""Stands in the place of the number of a vehicle ahead if a box is ahead."""


class Drivers(NamedTuple):
    """State of n drivers, in the order of their vehicles."""

    link: Integers
    """Link of the front axle; -1: off the roads, shape (n,)."""
    at: Floats
    """Place of the front axle on its link, from the start of the link [m], shape (n,)."""
    route: Integers
    """Links that follow, shape (n, ROUTE)."""
    behind: Integers
    """Link that the vehicle has left with its front axle; -1: none, shape (n,)."""
    granted: Integers
    """Gate that the driver may enter; -1: none, shape (n,)."""
    has_stopped: Integers
    """1: stood still before the next gate, shape (n,)."""
    asked: Integers
    """Tick at which the driver came near to the next gate; -1: has not, shape (n,)."""
    speed: Floats
    """Speed that the driver commands [m/s], shape (n,)."""
    signal: Integers
    """1: indicates a turn to the left; -1: to the right; else 0, shape (n,)."""
    is_braking: Integers
    """1: the brake lamps are on, shape (n,)."""
    desired: Floats
    """Speed at which the driver likes to drive [m/s], shape (n,)."""
    stream: NDArray[np.uint64]
    """Random numbers of the route, shape (n, 3)."""


class TrafficPlan(NamedTuple):
    """Working memory of a tick, which the next one does not read; n drivers."""

    gate: Integers
    """Next gate that is not granted; -1: none, shape (n,)."""
    exit: Integers
    """Link behind the next gate; -1: none, shape (n,)."""
    distance: Floats
    """Distance from the front of the vehicle to where it waits for the next gate [m], shape (n,)."""
    is_ready: Integers
    """1: only other vehicles at the gate can keep the driver from entering, shape (n,)."""
    is_claimed: Integers
    """1: waits at the gate for those who are in it, shape (n,)."""
    gap: Floats
    """Distance from the front of the vehicle to the vehicle or box ahead [m]; infinite: none is ahead, shape (n,)."""
    leader: Integers
    """Number of the vehicle ahead; -1: none; -2: a box is ahead, shape (n,)."""
    leader_speed: Floats
    """Speed of the vehicle ahead along the link [m/s], shape (n,)."""
    order: Integers
    """Drivers in the order in which they asked, shape (n,)."""


def new_drivers(shape: tuple[int, ...]) -> Drivers:
    """Drivers on no road, in columns of that shape."""
    return Drivers(
        link=np.full(shape, NONE, np.int64),
        at=np.zeros(shape),
        route=np.full((*shape, ROUTE), NONE, np.int64),
        behind=np.full(shape, NONE, np.int64),
        granted=np.full(shape, NONE, np.int64),
        has_stopped=np.zeros(shape, np.int64),
        asked=np.full(shape, NONE, np.int64),
        speed=np.zeros(shape),
        signal=np.zeros(shape, np.int64),
        is_braking=np.zeros(shape, np.int64),
        desired=np.ones(shape),
        stream=np.zeros((*shape, 3), np.uint64),
    )


@inlined
def drivers_of(k: int, drivers: Drivers) -> Drivers:
    """The drivers of world k, from columns of many worlds, whose first axis is the world."""
    d = drivers
    return Drivers(
        d.link[k],
        d.at[k],
        d.route[k],
        d.behind[k],
        d.granted[k],
        d.has_stopped[k],
        d.asked[k],
        d.speed[k],
        d.signal[k],
        d.is_braking[k],
        d.desired[k],
        d.stream[k],
    )


def new_plan(n: int) -> TrafficPlan:
    """Working memory of n drivers."""
    return TrafficPlan(
        gate=np.zeros(n, np.int64),
        exit=np.zeros(n, np.int64),
        distance=np.zeros(n),
        is_ready=np.zeros(n, np.int64),
        is_claimed=np.zeros(n, np.int64),
        gap=np.zeros(n),
        leader=np.zeros(n, np.int64),
        leader_speed=np.zeros(n),
        order=np.zeros(n, np.int64),
    )


class Bodies(NamedTuple):
    """Numbers of the v vehicles of the Model and the n drivers that do not change."""

    row: Integers
    """Number of the vehicle of each driver, shape (n,)."""
    driver: Integers
    """Number of the driver of each vehicle; -1: it has none, shape (v,)."""
    front: Floats
    """Distance from the origin of each vehicle to its front bumper [m], shape (v,)."""
    rear: Floats
    """Distance from the rear bumper of each vehicle to its origin [m], shape (v,)."""
    half_width: Floats
    """Half the width of each vehicle [m], shape (v,)."""
    wheelbase: Floats
    """Distance between the axles of each vehicle [m], shape (v,)."""
    steering_limit: Floats
    """Greatest steering angle of each vehicle [rad], shape (v,)."""
    box: Integers
    """Where the poses of the boxes are in `State.qpos`."""
    box_radius: Floats
    """Radius of a circle around each box, from above [m]."""
    top_speed: Floats
    """Speed of each vehicle at full throttle [m/s], shape (v,)."""


class Seen(NamedTuple):
    """Columns of the State that drivers see."""

    qpos: Floats
    position: Floats
    orientation: Floats
    velocity: Floats


@inlined
def idm_acceleration(speed: float, desired: float, gap: float, closing: float) -> float:
    """Acceleration [m/s^2] of the Intelligent Driver Model; `closing`: speed towards the vehicle ahead [m/s].

    Treiber, Hennecke, Helbing (2000), (2) and (3), with s1 = 0; the gap [m] is at least 1 mm.
    """
    share = speed / desired
    free = ACCELERATION * (1.0 - share * share * share * share)
    wished = JAM_GAP + max(0.0, speed * HEADWAY + speed * closing / (2.0 * sqrt(ACCELERATION * BRAKING)))
    ratio = wished / max(gap, 0.001)
    return free - ACCELERATION * ratio * ratio


@jit_uncounted
def drive(
    roads: Roads,
    bodies: Bodies,
    drivers: Drivers,
    plan: TrafficPlan,
    seen: Seen,
    lights: Integers,
    tick: int,
    dt: float,
    throttle: Floats,
    steering: Floats,
) -> None:
    """Write the commands of this tick [-1, 1] of the vehicles of the traffic, and the state of their drivers.

    `lights`: what each traffic light of the map shows (UNREGULATED to GREEN). `dt`: duration of a tick [s].
    """
    n = bodies.row.shape[0]
    for c in range(n):
        _locate(c, roads, bodies, drivers, seen)
    for c in range(n):
        _look_ahead(c, roads, bodies, drivers, plan, seen)
    for c in range(n):
        _note_gate(c, roads, bodies, drivers, plan, seen, lights, tick)
    _grant_gates(roads, bodies, drivers, plan, seen, tick, dt)
    for c in range(n):
        _command(c, roads, bodies, drivers, plan, seen, dt, throttle, steering)
        _indicate(c, roads, drivers)


@inlined
def _heading(row: int, seen: Seen) -> tuple[float, float]:
    """Unit vector of the direction of a vehicle, seen from above."""
    w, x, y, z = seen.orientation[row, 0], seen.orientation[row, 1], seen.orientation[row, 2], seen.orientation[row, 3]
    hx, hy = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z)
    length = max(sqrt(hx * hx + hy * hy), 1e-9)
    return hx / length, hy / length


@inlined
def _on_link(link: int, at: float, roads: Roads) -> tuple[float, float, float, float]:
    """Point at a place of a link [m], and the unit vector of its direction."""
    # between the two points of the centre line around the place; a place behind the end is at the end
    first, last = roads.point_first[link], roads.point_first[link + 1] - 1
    where = max(at, 0.0) / roads.spacing[link]
    k = min(int(where), last - first - 1)
    share = min(where - k, 1.0)
    p = roads.points
    a = first + k
    x, y = p[a, 0] + share * (p[a + 1, 0] - p[a, 0]), p[a, 1] + share * (p[a + 1, 1] - p[a, 1])
    tx, ty = p[a, 2] + share * (p[a + 1, 2] - p[a, 2]), p[a, 3] + share * (p[a + 1, 3] - p[a, 3])
    length = max(sqrt(tx * tx + ty * ty), 1e-9)
    return x, y, tx / length, ty / length


@inlined
def _drawn(link: int, roads: Roads, stream: NDArray[np.uint64]) -> int:
    """A link that follows, by chance."""
    first, count = roads.successor_first[link], roads.successor_first[link + 1] - roads.successor_first[link]
    if count == 1:
        return int(roads.successor[first])
    return int(roads.successor[first + min(int(uniform(stream) * count), count - 1)])


@inlined
def _front_axle(row: int, bodies: Bodies, seen: Seen) -> tuple[float, float]:
    hx, hy = _heading(row, seen)
    return (
        seen.position[row, 0] + bodies.wheelbase[row] * hx,
        seen.position[row, 1] + bodies.wheelbase[row] * hy,
    )


@inlined
def _locate(c: int, roads: Roads, bodies: Bodies, drivers: Drivers, seen: Seen) -> None:
    """Move the place of a driver with its front axle; find it anew if it is off its link."""
    row = bodies.row[c]
    x, y = _front_axle(row, bodies, seen)
    link = drivers.link[c]
    if link != NONE:  # the place moves by what the front axle has moved along the link since the last tick
        px, py, tx, ty = _on_link(link, drivers.at[c], roads)
        dx, dy = x - px, y - py
        if dx * dx + dy * dy > LOST * LOST:
            link = NONE
        else:
            drivers.at[c] = max(0.0, drivers.at[c] + dx * tx + dy * ty)
    if link == NONE:
        _find(c, x, y, roads, bodies, drivers, seen)
        return
    # behind the end of a link the next one of the route begins, and a new last one is drawn
    if drivers.at[c] > roads.length[link]:
        drivers.at[c] -= roads.length[link]
        drivers.behind[c] = link
        if drivers.granted[c] == link:
            drivers.granted[c] = NONE
        drivers.link[c] = drivers.route[c, 0]
        for k in range(1, ROUTE):
            drivers.route[c, k - 1] = drivers.route[c, k]
        drivers.route[c, ROUTE - 1] = _drawn(drivers.route[c, ROUTE - 2], roads, drivers.stream[c])
    if drivers.behind[c] != NONE and drivers.at[c] > bodies.wheelbase[row] + bodies.rear[row]:
        drivers.behind[c] = NONE


@inlined
def _find(c: int, x: float, y: float, roads: Roads, bodies: Bodies, drivers: Drivers, seen: Seen) -> None:
    """Look for the nearest place on all links in the direction of a vehicle; a new route begins there."""
    row = bodies.row[c]
    hx, hy = _heading(row, seen)
    least, nearest, at = LOST * LOST, NONE, 0.0
    for link in range(roads.length.shape[0]):
        first = roads.point_first[link]
        for k in range(first, roads.point_first[link + 1]):
            p = roads.points[k]
            away = (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y)
            if away < least and hx * p[2] + hy * p[3] > 0.5:
                least, nearest, at = away, link, (k - first) * roads.spacing[link]
    drivers.link[c], drivers.at[c] = nearest, at
    drivers.behind[c] = drivers.granted[c] = drivers.asked[c] = NONE
    drivers.has_stopped[c] = 0
    if nearest != NONE:
        before = nearest
        for k in range(ROUTE):
            before = _drawn(before, roads, drivers.stream[c])
            drivers.route[c, k] = before


@inlined
def _route(c: int, k: int, drivers: Drivers) -> int:
    """The link of a driver (0), and those that follow."""
    return drivers.link[c] if k == 0 else drivers.route[c, k - 1]


@inlined
def _look_ahead(c: int, roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan, seen: Seen) -> None:
    """Find the vehicle or box ahead: the first one that is in the way."""
    plan.gap[c], plan.leader[c], plan.leader_speed[c] = np.inf, NONE, 0.0
    if drivers.link[c] == NONE:
        return
    row = bodies.row[c]
    reach, own = LOOK, float(bodies.half_width[row]) + SIDE_MARGIN
    for other in range(bodies.driver.shape[0]):
        if other == row:
            continue
        # the other vehicle as a capsule: middle, half length of its axis, radius
        ox, oy = _heading(other, seen)
        half = bodies.half_width[other]
        nose, tail = bodies.front[other] - half, half - bodies.rear[other]
        mx = seen.position[other, 0] + 0.5 * (nose + tail) * ox
        my = seen.position[other, 1] + 0.5 * (nose + tail) * oy
        length = 0.5 * (nose - tail)
        way, between, along = _way_to(c, mx, my, ox, oy, length, half, own, reach, roads, bodies, drivers, seen)
        if way < reach:
            reach = way
            plan.gap[c] = way + between - (bodies.front[row] - bodies.wheelbase[row])
            plan.leader[c] = other
            plan.leader_speed[c] = seen.velocity[other, 0] * along
    for box in range(bodies.box.shape[0]):
        x, y = float(seen.qpos[bodies.box[box]]), float(seen.qpos[bodies.box[box] + 1])
        half = bodies.box_radius[box]
        way, between, _ = _way_to(c, x, y, 1.0, 0.0, 0.0, half, own, reach, roads, bodies, drivers, seen)
        if way < reach:
            reach = way
            plan.gap[c] = way + between - (bodies.front[row] - bodies.wheelbase[row])
            plan.leader[c], plan.leader_speed[c] = BOX, 0.0


@inlined
def _way_to(
    c: int,
    mx: float,
    my: float,
    ox: float,
    oy: float,
    length: float,
    half: float,
    own: float,
    reach: float,
    roads: Roads,
    bodies: Bodies,
    drivers: Drivers,
    seen: Seen,
) -> tuple[float, float, float]:
    """Way of a driver along its route to where a body is beside or before it [m], at most `reach`.

    Also the distance there from the centre line to that body [m], and the cosine between their directions. The body is
    a capsule from above: around `mx`, `my`, `length` to both sides along `ox`, `oy`, with the radius `half`. `own`:
    what the vehicle of the driver needs beside the centre line [m].
    """
    x, y = _front_axle(bodies.row[c], bodies, seen)
    hx, hy = _heading(bodies.row[c], seen)
    # most bodies are too far away or behind: they are left out before the walk along the route
    clear = own + half
    limit = reach + length + clear
    dx, dy = mx - x, my - y
    if dx * dx + dy * dy > limit * limit or dx * hx + dy * hy < -length - clear:
        return reach, 0.0, 0.0
    # walk along the centre lines of the route, every second point, until one is nearer to the capsule than `clear`
    link, at, way, k = drivers.link[c], drivers.at[c], 0.0, 0
    while way < reach:
        px, py, tx, ty = _on_link(link, at, roads)
        px, py = px - mx, py - my
        along = min(max(px * ox + py * oy, -length), length)  # nearest place on the axis of the capsule
        sx, sy = px - along * ox, py - along * oy
        away = sx * sx + sy * sy
        if away < clear * clear:
            return way, sqrt(away) - half, ox * tx + oy * ty
        way += 2.0 * roads.spacing[link]
        at += 2.0 * roads.spacing[link]
        if at > roads.length[link]:  # go on with the next link of the route
            if k == ROUTE:
                break
            at -= roads.length[link]
            k += 1
            link = _route(c, k, drivers)
    return reach, 0.0, 0.0


@inlined
def _is_inside(c: int, roads: Roads, bodies: Bodies, drivers: Drivers) -> bool:
    """Whether the front of a vehicle is past the line of the gate on which its front axle is."""
    link = drivers.link[c]
    if link == NONE or roads.is_gate[link] == 0:
        return False
    row = bodies.row[c]
    front = drivers.at[c] + bodies.front[row] - bodies.wheelbase[row]
    return front > roads.stop_at[link] + STOP_MARGIN


@inlined
def _note_gate(
    c: int, roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan, seen: Seen, lights: Integers, tick: int
) -> None:
    """Write the next gate that a driver has to wait for, and whether only vehicles in it can be in the way."""
    plan.gate[c], plan.exit[c], plan.distance[c] = NONE, NONE, np.inf
    plan.is_ready[c] = plan.is_claimed[c] = 0
    if drivers.link[c] == NONE:
        return
    row = bodies.row[c]
    speed = seen.velocity[row, 0]
    front = drivers.at[c] + bodies.front[row] - bodies.wheelbase[row]
    way = 0.0
    for k in range(ROUTE):
        link = _route(c, k, drivers)
        if roads.is_gate[link] == 1 and not (k == 0 and _is_inside(c, roads, bodies, drivers)):
            distance = way + roads.stop_at[link] - front
            light = UNREGULATED if roads.light[link] == NONE else lights[roads.light[link]]
            must_stop = light in (RED, YELLOW)
            if drivers.granted[c] == link:
                can_stop = distance > speed * speed / (2.0 * YELLOW_BRAKING)
                if can_stop and (must_stop or _user_comes(link, roads, bodies, seen)):
                    drivers.granted[c] = NONE
                else:
                    way += roads.length[link]
                    continue
            plan.gate[c], plan.distance[c] = link, distance
            plan.exit[c] = _route(c, k + 1, drivers)
            if distance < ASK and drivers.asked[c] == NONE:
                drivers.asked[c] = tick
            if speed < STOPPED and distance < 0.5 * (bodies.front[row] + bodies.rear[row]):
                drivers.has_stopped[c] = 1
            is_stopped = roads.is_stop[link] == 0 or drivers.has_stopped[c] == 1
            is_first = (
                plan.leader[c] == NONE or plan.gap[c] > distance or _has_passed(plan.leader[c], bodies, roads, drivers)
            )
            plan.is_ready[c] = not must_stop and is_stopped and is_first
            return
        way += roads.length[link]


@inlined
def _has_passed(vehicle: int, bodies: Bodies, roads: Roads, drivers: Drivers) -> bool:
    """Whether a vehicle that is ahead does not wait for a gate."""
    c = NONE if vehicle < 0 else bodies.driver[vehicle]
    return c != NONE and (drivers.granted[c] != NONE or _is_inside(c, roads, bodies, drivers))


@inlined
def _has_room(c: int, roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan) -> bool:
    """Whether the link behind the gate has room for one more vehicle, so that it does not stop in the gate."""
    link, gate = plan.exit[c], plan.gate[c]
    row = bodies.row[c]
    length = bodies.front[row] + bodies.rear[row]
    leader = plan.leader[c]
    if leader == BOX or (leader >= 0 and bodies.driver[leader] == NONE):
        needed = plan.distance[c] + roads.length[gate] - roads.stop_at[gate] + length + JAM_GAP
        if plan.gap[c] < needed and plan.leader_speed[c] < STOPPED:
            return False
    if roads.is_gate[link] == 1:
        return True
    room = max(1, int(roads.length[link] / (length + JAM_GAP)))
    for other in range(bodies.row.shape[0]):
        if other == c:
            continue
        if drivers.link[other] == link:
            room -= 1
        elif drivers.link[other] != NONE:
            for k in range(ROUTE):
                on = _route(other, k, drivers)
                is_in = k == 0 and _is_inside(other, roads, bodies, drivers)
                is_taken = roads.is_gate[on] == 1 and (is_in or drivers.granted[other] == on)
                if is_taken and _route(other, k + 1, drivers) == link:
                    room -= 1
    return room > 0


@inlined
def _is_taken(c: int, roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan) -> bool:
    """Whether another vehicle is in a gate that crosses or joins the one of a driver, or may enter it."""
    gate = plan.gate[c]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        rival, end = roads.conflict[r], roads.conflict_end[r]
        for other in range(bodies.row.shape[0]):
            if other == c or drivers.link[other] == NONE:
                continue
            row = bodies.row[other]
            tail = drivers.at[other] - bodies.wheelbase[row] - bodies.rear[row]
            if drivers.granted[other] == rival and drivers.link[other] != rival:
                return True
            is_in = drivers.granted[other] == rival or _is_inside(other, roads, bodies, drivers)
            if drivers.link[other] == rival and is_in and tail < end:
                return True
            if drivers.behind[other] == rival and tail + roads.length[rival] < end:
                return True
    return False


@inlined
def _is_user_in(vehicle: int, gate: int, roads: Roads, bodies: Bodies, seen: Seen) -> bool:
    """Whether a vehicle without a driver of the traffic is in a gate, or its middle is, in its direction."""
    hx, hy = _heading(vehicle, seen)
    middle = 0.5 * (bodies.front[vehicle] - bodies.rear[vehicle])
    x, y = seen.position[vehicle, 0] + middle * hx, seen.position[vehicle, 1] + middle * hy
    near = bodies.half_width[vehicle]
    first = roads.point_first[gate]
    for k in range(first, roads.point_first[gate + 1], 3):
        p = roads.points[k]
        away = (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y)
        at = (k - first) * roads.spacing[gate]
        if away < near * near and hx * p[2] + hy * p[3] > 0.5 and at > roads.stop_at[gate]:
            return True
    return False


@inlined
def _must_yield(c: int, roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan, seen: Seen) -> bool:
    """Whether a vehicle with the right of way comes before the critical gap is over."""
    gate = plan.gate[c]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        if roads.yields[r] != 1:
            continue
        for other in range(bodies.row.shape[0]):
            if other != c and plan.gate[other] == roads.conflict[r] and plan.is_ready[other] == 1:
                speed = max(seen.velocity[bodies.row[other], 0], 0.1)
                if plan.distance[other] < speed * roads.critical_gap[gate]:
                    return True
    return False


@inlined
def _user_comes(gate: int, roads: Roads, bodies: Bodies, seen: Seen) -> bool:
    """Whether a vehicle that the traffic does not drive is where it crosses or joins a gate, or comes before the gap.

    It has the right of way unless a sign says otherwise.
    """
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        rival = roads.conflict[r]
        x, y, tx, ty = _on_link(int(rival), float(roads.stop_at[rival]), roads)  # the stop line of the rival gate
        for vehicle in range(bodies.driver.shape[0]):
            if bodies.driver[vehicle] != NONE:
                continue
            if _is_user_in(vehicle, rival, roads, bodies, seen):
                return True
            # in the axes of the vehicle: how far the line is ahead of its front, and beside it
            hx, hy = _heading(vehicle, seen)
            dx, dy = x - seen.position[vehicle, 0], y - seen.position[vehicle, 1]
            ahead, aside = dx * hx + dy * hy - bodies.front[vehicle], dy * hx - dx * hy
            speed, length = seen.velocity[vehicle, 0], bodies.front[vehicle] + bodies.rear[vehicle]
            is_near = speed > STOPPED and -length < ahead < speed * roads.critical_gap[gate]
            is_on_lane = abs(aside) < bodies.half_width[vehicle] and hx * tx + hy * ty > 0.8
            if roads.yields[r] >= 0 and is_near and is_on_lane:
                return True
    return False


@inlined
def _is_claimed(c: int, roads: Roads, plan: TrafficPlan) -> bool:
    """Whether a driver who asked before waits at a gate that crosses or joins, and need not give way."""
    gate = plan.gate[c]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        for other in range(plan.gate.shape[0]):
            is_waiting = plan.is_claimed[other] > 0 and plan.gate[other] == roads.conflict[r]
            if is_waiting and (roads.yields[r] >= 0 or plan.is_claimed[other] == 2):
                return True
    return False


@inlined
def _grant_gates(
    roads: Roads, bodies: Bodies, drivers: Drivers, plan: TrafficPlan, seen: Seen, tick: int, dt: float
) -> None:
    """Let drivers enter their gates, in the order in which they asked."""
    n = bodies.row.shape[0]
    # sort those who ask by the tick at which they asked: each is inserted behind all that asked before
    count = 0
    for c in range(n):
        if plan.is_ready[c] == 1 and drivers.asked[c] != NONE and plan.distance[c] < ASK:
            k = count
            while k > 0 and drivers.asked[plan.order[k - 1]] > drivers.asked[c]:
                plan.order[k] = plan.order[k - 1]
                k -= 1
            plan.order[k] = c
            count += 1
    # let them enter one by one; who has waited too long gives way no more
    for k in range(count):
        c = plan.order[k]
        if not _has_room(c, roads, bodies, drivers, plan):
            continue
        is_patient = (tick - drivers.asked[c]) * dt < PATIENCE
        if (
            _is_claimed(c, roads, plan)
            or _is_taken(c, roads, bodies, drivers, plan)
            or _user_comes(int(plan.gate[c]), roads, bodies, seen)
            or (is_patient and _must_yield(c, roads, bodies, drivers, plan, seen))
        ):
            if plan.distance[c] < AT_LINE:
                plan.is_claimed[c] = 1 if is_patient else 2
            continue
        drivers.granted[c] = plan.gate[c]
        drivers.asked[c], drivers.has_stopped[c] = NONE, 0
        plan.gate[c] = NONE


@inlined
def _command(
    c: int,
    roads: Roads,
    bodies: Bodies,
    drivers: Drivers,
    plan: TrafficPlan,
    seen: Seen,
    dt: float,
    throttle: Floats,
    steering: Floats,
) -> None:
    """Write the commands of a driver."""
    row = bodies.row[c]
    link = drivers.link[c]
    throttle[row] = steering[row] = 0.0
    if link == NONE:
        drivers.speed[c], drivers.is_braking[c] = 0.0, 1
        return
    # speed: the one commanded before, but close to the actual one, and from it the acceleration of the model
    actual, desired = seen.velocity[row, 0], drivers.desired[c]
    speed = min(max(drivers.speed[c], actual - 0.1), max(actual, 0.0) + 0.1)
    before = speed
    acceleration = idm_acceleration(speed, desired, plan.gap[c], speed - plan.leader_speed[c])
    if plan.gate[c] != NONE:  # the stop line is like the end of a standing vehicle
        gap = plan.distance[c] - STOP_MARGIN + JAM_GAP
        acceleration = min(acceleration, idm_acceleration(speed, desired, gap, speed))
    speed += acceleration * dt
    if plan.gate[c] != NONE:  # the model alone may stop a little behind the line
        speed = min(speed, sqrt(2.0 * YELLOW_BRAKING * max(plan.distance[c] - LINE_MARGIN, 0.0)))
    drivers.speed[c] = min(max(speed, 0.0), bodies.top_speed[row])
    # brake lamps, with a hysteresis
    deceleration = (before - drivers.speed[c]) / dt
    is_standing = drivers.speed[c] < STOPPED and deceleration >= 0.0
    if is_standing or deceleration > BRAKE_ON:
        drivers.is_braking[c] = 1
    elif deceleration < BRAKE_OFF:
        drivers.is_braking[c] = 0
    throttle[row] = drivers.speed[c] / bodies.top_speed[row]
    # steering (Hoffmann, (5)): the angle to the direction of the link, less one that grows with the cross-track error
    x, y = _front_axle(row, bodies, seen)
    hx, hy = _heading(row, seen)
    px, py, tx, ty = _on_link(link, drivers.at[c], roads)
    left = tx * (y - py) - ty * (x - px)
    turn = atan2(hx * ty - hy * tx, hx * tx + hy * ty)
    angle = turn - atan(STEERING_GAIN * left / (max(actual, 0.0) + STEERING_SPEED))
    steering[row] = min(max(angle / bodies.steering_limit[row], -1.0), 1.0)


@inlined
def _indicate(c: int, roads: Roads, drivers: Drivers) -> None:
    """Write the indicators of a driver: the next turn on the route, until the front axle has left it."""
    drivers.signal[c] = 0
    if drivers.link[c] == NONE:
        return
    way = -drivers.at[c]
    for k in range(ROUTE + 1):
        link = _route(c, k, drivers)
        if way > SIGNAL:
            return
        if roads.turn[link] != 0:
            drivers.signal[c] = roads.turn[link]
            return
        way += roads.length[link]
