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
from autodrive.base.jit import inlined
from autodrive.physics.model import Table, columns
from autodrive.physics.sensors.random_stream import uniform
from autodrive.physics.state import State
from autodrive.scenario.maps.light_programs import PROGRAM, SET
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


DRIVER = columns(
    link=np.int64,  # of the front axle; -1: off the roads
    at=np.float64,  # place of the front axle on its link, from the start of the link [m]
    route=(np.int64, ROUTE),  # links that follow
    behind=np.int64,  # link that the vehicle has left with its front axle; -1: none
    granted=np.int64,  # gate that the driver may enter; -1: none
    has_stopped=np.bool_,  # stood still before the next gate
    asked=np.int64,  # tick at which the driver came near to the next gate; -1: has not
    speed=np.float64,  # that the driver commands [m/s]
    signal=np.int64,  # 1: indicates a turn to the left; -1: to the right; else 0
    signal_since=np.int64,  # tick at which the driver began to indicate
    is_braking=np.bool_,  # the brake lamps are on
    desired=np.float64,  # speed at which the driver likes to drive [m/s]
    stream=(np.uint64, 3),  # random numbers of the route
    # written in each tick, before they are read
    gate=np.int64,  # next gate that is not granted; -1: none
    exit=np.int64,  # link behind the next gate; -1: none
    distance=np.float64,  # from the front of the vehicle to where it waits for the next gate [m]
    is_ready=np.bool_,  # only other vehicles at the gate can keep the driver from entering
    claim=np.int64,  # waits at the gate for those who are in it: 1, or 2 if it gives way no more; else 0
    gap=np.float64,  # from the front of the vehicle to the vehicle or box ahead [m]; infinite: none is ahead
    leader=np.int64,  # number of the vehicle ahead; -1: none; -2: a box is ahead
    leader_speed=np.float64,  # of the vehicle ahead, along the link [m/s]
    order=np.int64,  # in the first rows: the drivers who ask for a gate, in the order in which they asked
)
"""Columns of the drivers, in the order of their vehicles."""

CAR = columns(
    driver=np.int64,  # -1: it has none
    front=np.float64,  # distance from the origin to the front bumper [m]
    rear=np.float64,  # distance from the rear bumper to the origin [m]
    half_width=np.float64,  # [m]
    wheelbase=np.float64,  # [m]
    steering_limit=np.float64,  # greatest steering angle [rad]
    top_speed=np.float64,  # at full throttle [m/s]
)
"""Columns of what the drivers know of all vehicles of the Model."""


class TrafficTable(NamedTuple):
    """What does not change."""

    roads: Roads
    """Roads on which the traffic drives."""
    cars: Table
    """Columns `CAR`, shape (v,)."""
    rows: Integers
    """Number of the vehicle of each driver, shape (n,)."""
    boxes: Integers
    """Where the poses of the boxes are in `State.qpos`."""
    box_radius: Floats
    """Radius of a circle around each box, from above [m]."""
    tick: float
    """Duration of a tick [s]."""


class Traffic(NamedTuple):
    """All that the n drivers of a world read and write in a tick."""

    table: TrafficTable
    drivers: Table
    """Columns `DRIVER`, shape (n,)."""
    state: State
    light_mode: Integers
    """`LightColumns.mode` of the world."""
    light_state: Integers
    """`LightColumns.state` of the world."""
    tick: int


class Capsule(NamedTuple):
    """A body from above: all points that are nearer to a line than its radius [m]."""

    x: float
    """Middle of the line."""
    y: float
    """Middle of the line."""
    along_x: float
    """Unit vector along the line."""
    along_y: float
    """Unit vector along the line."""
    half_length: float
    """Half the length of the line."""
    radius: float


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


@inlined
def drive(traffic: Traffic, throttle: Floats, steering: Floats) -> None:
    """Write the commands of this tick [-1, 1] of the vehicles of the traffic, and the state of their drivers."""
    n = traffic.drivers.shape[0]
    for c in range(n):
        _locate(c, traffic)
    for c in range(n):
        _look_ahead(c, traffic)
    for c in range(n):
        _note_gate(c, traffic)
    _grant_gates(traffic)
    for c in range(n):
        _command(c, traffic, throttle, steering)
        _indicate(c, traffic)


@inlined
def _heading(row: int, traffic: Traffic) -> tuple[float, float]:
    """Unit vector of the direction of a vehicle, seen from above."""
    orientation = traffic.state.vehicle_orientation
    w, x, y, z = orientation[row, 0], orientation[row, 1], orientation[row, 2], orientation[row, 3]
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
def _front_axle(row: int, traffic: Traffic) -> tuple[float, float]:
    hx, hy = _heading(row, traffic)
    position, wheelbase = traffic.state.vehicle_position, traffic.table.cars[row]["wheelbase"]
    return position[row, 0] + wheelbase * hx, position[row, 1] + wheelbase * hy


@inlined
def _locate(c: int, traffic: Traffic) -> None:
    """Move the place of a driver with its front axle; find it anew if it is off its link."""
    driver, roads = traffic.drivers[c], traffic.table.roads
    car = traffic.table.cars[traffic.table.rows[c]]
    x, y = _front_axle(traffic.table.rows[c], traffic)
    link = driver["link"]
    if link != NONE:  # the place moves by what the front axle has moved along the link since the last tick
        px, py, tx, ty = _on_link(link, driver["at"], roads)
        dx, dy = x - px, y - py
        if dx * dx + dy * dy > LOST * LOST:
            link = NONE
        else:
            driver["at"] = max(0.0, driver["at"] + dx * tx + dy * ty)
    if link == NONE:
        _find(c, x, y, traffic)
        return
    # behind the end of a link the next one of the route begins, and a new last one is drawn
    if driver["at"] > roads.length[link]:
        driver["at"] -= roads.length[link]
        driver["behind"] = link
        if driver["granted"] == link:
            driver["granted"] = NONE
        route = driver["route"]
        driver["link"] = route[0]
        for k in range(1, ROUTE):
            route[k - 1] = route[k]
        route[ROUTE - 1] = _drawn(route[ROUTE - 2], roads, driver["stream"])
    if driver["behind"] != NONE and driver["at"] > car["wheelbase"] + car["rear"]:
        driver["behind"] = NONE


@inlined
def _find(c: int, x: float, y: float, traffic: Traffic) -> None:
    """Look for the nearest place on all links in the direction of a vehicle; a new route begins there."""
    driver, roads = traffic.drivers[c], traffic.table.roads
    hx, hy = _heading(traffic.table.rows[c], traffic)
    least, nearest, at = LOST * LOST, NONE, 0.0
    for link in range(roads.length.shape[0]):
        first = roads.point_first[link]
        for k in range(first, roads.point_first[link + 1]):
            p = roads.points[k]
            away = (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y)
            if away < least and hx * p[2] + hy * p[3] > 0.5:
                least, nearest, at = away, link, (k - first) * roads.spacing[link]
    driver["link"], driver["at"] = nearest, at
    driver["behind"] = driver["granted"] = driver["asked"] = NONE
    driver["has_stopped"] = False
    if nearest != NONE:
        before = nearest
        for k in range(ROUTE):
            before = _drawn(before, roads, driver["stream"])
            driver["route"][k] = before


@inlined
def _route(c: int, k: int, traffic: Traffic) -> int:
    """The link of a driver (0), and those that follow."""
    driver = traffic.drivers[c]
    return driver["link"] if k == 0 else driver["route"][k - 1]


@inlined
def _look_ahead(c: int, traffic: Traffic) -> None:
    """Find the vehicle or box ahead: the first one that is in the way."""
    driver, cars, state = traffic.drivers[c], traffic.table.cars, traffic.state
    driver["gap"], driver["leader"], driver["leader_speed"] = np.inf, NONE, 0.0
    if driver["link"] == NONE:
        return
    row, reach = traffic.table.rows[c], LOOK
    nose = cars[row]["front"] - cars[row]["wheelbase"]
    for other in range(cars.shape[0]):
        if other == row:
            continue
        ox, oy = _heading(other, traffic)
        radius = cars[other]["half_width"]
        front, rear = cars[other]["front"] - radius, radius - cars[other]["rear"]  # ends of the line of the capsule
        mx = state.vehicle_position[other, 0] + 0.5 * (front + rear) * ox
        my = state.vehicle_position[other, 1] + 0.5 * (front + rear) * oy
        way, between, along = _way_to(c, Capsule(mx, my, ox, oy, 0.5 * (front - rear), radius), reach, traffic)
        if way < reach:
            reach = way
            driver["gap"], driver["leader"] = way + between - nose, other
            driver["leader_speed"] = state.vehicle_velocity[other, 0] * along
    for box in range(traffic.table.boxes.shape[0]):
        place = traffic.table.boxes[box]
        x, y = float(state.qpos[place]), float(state.qpos[place + 1])
        way, between, _ = _way_to(c, Capsule(x, y, 1.0, 0.0, 0.0, traffic.table.box_radius[box]), reach, traffic)
        if way < reach:
            reach = way
            driver["gap"], driver["leader"], driver["leader_speed"] = way + between - nose, BOX, 0.0


@inlined
def _way_to(c: int, body: Capsule, reach: float, traffic: Traffic) -> tuple[float, float, float]:
    """Way of a driver along its route to where a body is beside or before it [m], at most `reach`.

    Also the distance there from the centre line to that body [m], and the cosine between their directions.
    """
    driver, row, roads = traffic.drivers[c], traffic.table.rows[c], traffic.table.roads
    mx, my, ox, oy, length, radius = body
    x, y = _front_axle(row, traffic)
    hx, hy = _heading(row, traffic)
    # most bodies are too far away or behind: they are left out before the walk along the route
    clear = traffic.table.cars[row]["half_width"] + SIDE_MARGIN + radius
    limit = reach + length + clear
    dx, dy = mx - x, my - y
    if dx * dx + dy * dy > limit * limit or dx * hx + dy * hy < -length - clear:
        return reach, 0.0, 0.0
    # walk along the centre lines of the route, every second point, until one is nearer to the capsule than `clear`
    link, at, way, k = driver["link"], driver["at"], 0.0, 0
    while way < reach:
        px, py, tx, ty = _on_link(link, at, roads)
        px, py = px - mx, py - my
        along = min(max(px * ox + py * oy, -length), length)  # nearest place on the line of the capsule
        sx, sy = px - along * ox, py - along * oy
        away = sx * sx + sy * sy
        if away < clear * clear:
            return way, sqrt(away) - radius, ox * tx + oy * ty
        way += 2.0 * roads.spacing[link]
        at += 2.0 * roads.spacing[link]
        if at > roads.length[link]:  # go on with the next link of the route
            if k == ROUTE:
                break
            at -= roads.length[link]
            k += 1
            link = _route(c, k, traffic)
    return reach, 0.0, 0.0


@inlined
def _front(c: int, traffic: Traffic) -> float:
    """Place of the front bumper of a driver on its link [m]."""
    car = traffic.table.cars[traffic.table.rows[c]]
    return traffic.drivers[c]["at"] + car["front"] - car["wheelbase"]


@inlined
def _is_inside(c: int, traffic: Traffic) -> bool:
    """Whether the front of a vehicle is past the line of the gate on which its front axle is."""
    link, roads = traffic.drivers[c]["link"], traffic.table.roads
    if link == NONE or roads.is_gate[link] == 0:
        return False
    return bool(_front(c, traffic) > roads.stop_at[link] + STOP_MARGIN)


@inlined
def _light(link: int, traffic: Traffic) -> int:
    """What a driver sees of the traffic light of a link (UNREGULATED to GREEN)."""
    light = traffic.table.roads.light[link]
    if light == NONE or (traffic.light_mode[light] != PROGRAM and traffic.light_mode[light] != SET):
        return UNREGULATED
    return int(traffic.light_state[light])


@inlined
def _note_gate(c: int, traffic: Traffic) -> None:
    """Write the next gate that a driver has to wait for, and whether only vehicles in it can be in the way."""
    driver, roads, row = traffic.drivers[c], traffic.table.roads, traffic.table.rows[c]
    driver["gate"], driver["exit"], driver["distance"] = NONE, NONE, np.inf
    driver["is_ready"], driver["claim"] = False, 0
    if driver["link"] == NONE:
        return
    speed, car = traffic.state.vehicle_velocity[row, 0], traffic.table.cars[row]
    way = 0.0
    for k in range(ROUTE):
        link = _route(c, k, traffic)
        if roads.is_gate[link] == 1 and not (k == 0 and _is_inside(c, traffic)):
            distance = way + roads.stop_at[link] - _front(c, traffic)
            light = _light(link, traffic)
            must_stop = light in (RED, YELLOW)
            if driver["granted"] == link:
                can_stop = distance > speed * speed / (2.0 * YELLOW_BRAKING)
                if can_stop and (must_stop or _user_comes(link, traffic)):
                    driver["granted"] = NONE
                else:
                    way += roads.length[link]
                    continue
            driver["gate"], driver["distance"] = link, distance
            driver["exit"] = _route(c, k + 1, traffic)
            if distance < ASK and driver["asked"] == NONE:
                driver["asked"] = traffic.tick
            if speed < STOPPED and distance < 0.5 * (car["front"] + car["rear"]):
                driver["has_stopped"] = True
            is_stopped = roads.is_stop[link] == 0 or driver["has_stopped"]
            is_first = driver["leader"] == NONE or driver["gap"] > distance or _has_passed(driver["leader"], traffic)
            driver["is_ready"] = not must_stop and is_stopped and is_first
            return
        way += roads.length[link]


@inlined
def _has_passed(vehicle: int, traffic: Traffic) -> bool:
    """Whether a vehicle that is ahead does not wait for a gate."""
    c = NONE if vehicle < 0 else traffic.table.cars[vehicle]["driver"]
    return c != NONE and (traffic.drivers[c]["granted"] != NONE or _is_inside(c, traffic))


@inlined
def _has_room(c: int, traffic: Traffic) -> bool:
    """Whether the link behind the gate has room for one more vehicle, so that it does not stop in the gate."""
    driver, roads, cars = traffic.drivers[c], traffic.table.roads, traffic.table.cars
    link, gate, leader = driver["exit"], driver["gate"], driver["leader"]
    car = cars[traffic.table.rows[c]]
    length = car["front"] + car["rear"]
    if leader == BOX or (leader >= 0 and cars[leader]["driver"] == NONE):
        needed = driver["distance"] + roads.length[gate] - roads.stop_at[gate] + length + JAM_GAP
        if driver["gap"] < needed and driver["leader_speed"] < STOPPED:
            return False
    if roads.is_gate[link] == 1:
        return True
    room = max(1, int(roads.length[link] / (length + JAM_GAP)))
    for other in range(traffic.drivers.shape[0]):
        if other == c:
            continue
        if traffic.drivers[other]["link"] == link:
            room -= 1
        elif traffic.drivers[other]["link"] != NONE:
            for k in range(ROUTE):
                on = _route(other, k, traffic)
                is_in = k == 0 and _is_inside(other, traffic)
                is_taken = roads.is_gate[on] == 1 and (is_in or traffic.drivers[other]["granted"] == on)
                if is_taken and _route(other, k + 1, traffic) == link:
                    room -= 1
    return room > 0


@inlined
def _is_taken(c: int, traffic: Traffic) -> bool:
    """Whether another vehicle is in a gate that crosses or joins the one of a driver, or may enter it."""
    roads, gate = traffic.table.roads, traffic.drivers[c]["gate"]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        rival, end = roads.conflict[r], roads.conflict_end[r]
        for d in range(traffic.drivers.shape[0]):
            other, car = traffic.drivers[d], traffic.table.cars[traffic.table.rows[d]]
            if d == c or other["link"] == NONE:
                continue
            tail = other["at"] - car["wheelbase"] - car["rear"]
            if other["granted"] == rival and other["link"] != rival:
                return True
            is_in = other["granted"] == rival or _is_inside(d, traffic)
            if other["link"] == rival and is_in and tail < end:
                return True
            if other["behind"] == rival and tail + roads.length[rival] < end:
                return True
    return False


@inlined
def _is_user_in(vehicle: int, gate: int, traffic: Traffic) -> bool:
    """Whether a vehicle without a driver of the traffic is in a gate, or its middle is, in its direction."""
    roads, car, position = traffic.table.roads, traffic.table.cars[vehicle], traffic.state.vehicle_position
    hx, hy = _heading(vehicle, traffic)
    middle = 0.5 * (car["front"] - car["rear"])
    x, y = position[vehicle, 0] + middle * hx, position[vehicle, 1] + middle * hy
    near = car["half_width"]
    first = roads.point_first[gate]
    for k in range(first, roads.point_first[gate + 1], 3):
        p = roads.points[k]
        away = (p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y)
        at = (k - first) * roads.spacing[gate]
        if away < near * near and hx * p[2] + hy * p[3] > 0.5 and at > roads.stop_at[gate]:
            return True
    return False


@inlined
def _must_yield(c: int, traffic: Traffic) -> bool:
    """Whether a vehicle with the right of way comes before the critical gap is over."""
    roads, gate = traffic.table.roads, traffic.drivers[c]["gate"]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        if roads.yields[r] != 1:
            continue
        for d in range(traffic.drivers.shape[0]):
            other = traffic.drivers[d]
            if d != c and other["gate"] == roads.conflict[r] and other["is_ready"]:
                speed = max(traffic.state.vehicle_velocity[traffic.table.rows[d], 0], 0.1)
                if other["distance"] < speed * roads.critical_gap[gate]:
                    return True
    return False


@inlined
def _user_comes(gate: int, traffic: Traffic) -> bool:
    """Whether a vehicle that the traffic does not drive is where it crosses or joins a gate, or comes before the gap.

    It has the right of way unless a sign says otherwise.
    """
    roads, cars, state = traffic.table.roads, traffic.table.cars, traffic.state
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        rival = roads.conflict[r]
        x, y, tx, ty = _on_link(int(rival), float(roads.stop_at[rival]), roads)  # the stop line of the rival gate
        for vehicle in range(cars.shape[0]):
            car = cars[vehicle]
            if car["driver"] != NONE:
                continue
            if _is_user_in(vehicle, rival, traffic):
                return True
            # in the axes of the vehicle: how far the line is ahead of its front, and beside it
            hx, hy = _heading(vehicle, traffic)
            dx, dy = x - state.vehicle_position[vehicle, 0], y - state.vehicle_position[vehicle, 1]
            ahead, aside = dx * hx + dy * hy - car["front"], dy * hx - dx * hy
            speed, length = state.vehicle_velocity[vehicle, 0], car["front"] + car["rear"]
            is_near = speed > STOPPED and -length < ahead < speed * roads.critical_gap[gate]
            is_on_lane = abs(aside) < car["half_width"] and hx * tx + hy * ty > 0.8
            if roads.yields[r] >= 0 and is_near and is_on_lane:
                return True
    return False


@inlined
def _is_claimed(c: int, traffic: Traffic) -> bool:
    """Whether a driver who asked before waits at a gate that crosses or joins, and need not give way."""
    roads, gate = traffic.table.roads, traffic.drivers[c]["gate"]
    for r in range(roads.conflict_first[gate], roads.conflict_first[gate + 1]):
        for d in range(traffic.drivers.shape[0]):
            other = traffic.drivers[d]
            is_waiting = other["claim"] > 0 and other["gate"] == roads.conflict[r]
            if is_waiting and (roads.yields[r] >= 0 or other["claim"] == 2):
                return True
    return False


@inlined
def _grant_gates(traffic: Traffic) -> None:
    """Let drivers enter their gates, in the order in which they asked."""
    drivers = traffic.drivers
    # sort those who ask by the tick at which they asked: each is inserted behind all that asked before
    count = 0
    for c in range(drivers.shape[0]):
        if drivers[c]["is_ready"] and drivers[c]["asked"] != NONE and drivers[c]["distance"] < ASK:
            k = count
            while k > 0 and drivers[drivers[k - 1]["order"]]["asked"] > drivers[c]["asked"]:
                drivers[k]["order"] = drivers[k - 1]["order"]
                k -= 1
            drivers[k]["order"] = c
            count += 1
    # let them enter one by one; who has waited too long gives way no more
    for k in range(count):
        c = drivers[k]["order"]
        driver = drivers[c]
        if not _has_room(c, traffic):
            continue
        is_patient = (traffic.tick - driver["asked"]) * traffic.table.tick < PATIENCE
        if (
            _is_claimed(c, traffic)
            or _is_taken(c, traffic)
            or _user_comes(int(driver["gate"]), traffic)
            or (is_patient and _must_yield(c, traffic))
        ):
            if driver["distance"] < AT_LINE:
                driver["claim"] = 1 if is_patient else 2
            continue
        driver["granted"] = driver["gate"]
        driver["asked"], driver["has_stopped"] = NONE, False
        driver["gate"] = NONE


@inlined
def _command(c: int, traffic: Traffic, throttle: Floats, steering: Floats) -> None:
    """Write the commands of a driver."""
    driver, row, dt = traffic.drivers[c], traffic.table.rows[c], traffic.table.tick
    car = traffic.table.cars[row]
    throttle[row] = steering[row] = 0.0
    if driver["link"] == NONE:
        driver["speed"], driver["is_braking"] = 0.0, True
        return
    # speed: the one commanded before, but close to the actual one, and from it the acceleration of the model
    actual, desired, distance = traffic.state.vehicle_velocity[row, 0], driver["desired"], driver["distance"]
    speed = min(max(driver["speed"], actual - 0.1), max(actual, 0.0) + 0.1)
    before = speed
    acceleration = idm_acceleration(speed, desired, driver["gap"], speed - driver["leader_speed"])
    if driver["gate"] != NONE:  # the stop line is like the end of a standing vehicle
        gap = distance - STOP_MARGIN + JAM_GAP
        acceleration = min(acceleration, idm_acceleration(speed, desired, gap, speed))
    speed += acceleration * dt
    if driver["gate"] != NONE:  # the model alone may stop a little behind the line
        speed = min(speed, sqrt(2.0 * YELLOW_BRAKING * max(distance - LINE_MARGIN, 0.0)))
    speed = min(max(speed, 0.0), car["top_speed"])
    driver["speed"] = speed
    # brake lamps, with a hysteresis
    deceleration = (before - speed) / dt
    is_standing = speed < STOPPED and deceleration >= 0.0
    if is_standing or deceleration > BRAKE_ON:
        driver["is_braking"] = True
    elif deceleration < BRAKE_OFF:
        driver["is_braking"] = False
    throttle[row] = speed / car["top_speed"]
    # steering (Hoffmann, (5)): the angle to the direction of the link, less one that grows with the cross-track error
    x, y = _front_axle(row, traffic)
    hx, hy = _heading(row, traffic)
    px, py, tx, ty = _on_link(driver["link"], driver["at"], traffic.table.roads)
    left = tx * (y - py) - ty * (x - px)
    turn = atan2(hx * ty - hy * tx, hx * tx + hy * ty)
    angle = turn - atan(STEERING_GAIN * left / (max(actual, 0.0) + STEERING_SPEED))
    steering[row] = min(max(angle / car["steering_limit"], -1.0), 1.0)


@inlined
def _indicate(c: int, traffic: Traffic) -> None:
    """Write the indicators of a driver: the next turn on the route, until the front axle has left it."""
    driver, roads = traffic.drivers[c], traffic.table.roads
    before, driver["signal"] = driver["signal"], 0
    if driver["link"] == NONE:
        return
    way = -driver["at"]
    for k in range(ROUTE + 1):
        link = _route(c, k, traffic)
        if way > SIGNAL:
            return
        if roads.turn[link] != 0:
            driver["signal"] = roads.turn[link]
            if before == 0:
                driver["signal_since"] = traffic.tick
            return
        way += roads.length[link]
