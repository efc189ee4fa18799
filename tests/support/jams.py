"""Cars that drive into each other, and the energy of all bodies while they do."""

import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

import autodrive
from autodrive import Command
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.physics.tick import place
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world import World

TYPES = ("nigel", "nigel_2020", "nigel_2023", "roboracer", "roboracer_f1tenth", "roboracer_physical", "neoracer")
ARENAS = ("plane", "walls", "boxes")
SUBSTEP = 0.001


class Jam(NamedTuple):
    """What happened in a jam."""

    top_speed: float
    """Of the centre of mass of any car [m/s]."""
    gain: float
    """Largest rise of the energy that no motor did, divided by the kinetic energy; see `Energy`."""
    excess: float
    """Kinetic energy at most, divided by what it was at the start plus what the motors did."""
    load: float
    """Largest of any wheel, divided by its static load."""


class Energy:
    """Energy of all bodies of a world [J] and the work of the treads of the wheels, which the motors turn.

    Energy: of the motion of the bodies, their height, springs and stops of the wheels. A tread gives force times tread
    speed; slip, dampers, air and contacts can only take energy.
    """

    def __init__(self, world: World) -> None:
        c = self.compiled = world.compiled
        engine = c.engine.model
        bodies = engine.jnt_bodyid
        self._qpos, self._dof = engine.jnt_qposadr[:, None] + np.arange(7), engine.jnt_dofadr[:, None] + np.arange(6)
        self._mass, self._centre = engine.body_mass[bodies], engine.body_ipos[bodies]
        axes = np.array([rotation_from_quaternion(q) for q in engine.body_iquat[bodies]]).reshape(-1, 3, 3)
        self._inertia = np.einsum("bij,bj,bkj->bik", axes, engine.body_inertia[bodies], axes)
        self._moved = np.cross(np.eye(3), self._centre[:, None]).swapaxes(1, 2)  # velocity of the centre by a turn
        self._cars = slice(len(bodies) - len(c.vehicles), None)
        self.tread_work = self.motor_work = 0.0
        """Since the start [J]: of all treads, and of those that push."""

    def observe_substep(self) -> None:
        """After each substep."""
        state, dt = self.compiled.state, self.compiled.model.dt
        tread = self.compiled.model.wheels["radius"] * state.wheel_angular_velocity
        work = state.wheel_force[:, 0] * tread * dt
        self.tread_work += float(work.sum())
        self.motor_work += float(np.maximum(work, 0.0).sum())

    def now(self) -> tuple[float, float, float]:
        """Kinetic energy; all energy less the work of the treads; top speed of a car [m/s]."""
        c = self.compiled
        q, v = c.state.qpos[self._qpos], c.state.qvel[self._dof]
        rotation = np.array(rotation_from_quaternion(tuple(q[:, 3:].T))).T.reshape(-1, 3, 3)
        turn = v[:, 3:]
        velocity = v[:, :3] + np.einsum("bij,bjk,bk->bi", rotation, self._moved, turn)
        speed = np.sqrt((velocity * velocity).sum(axis=1))
        kinetic = 0.5 * float(self._mass @ speed**2 + np.einsum("bi,bij,bj->", turn, self._inertia, turn))
        height = q[:, 2] + np.einsum("bj,bj->b", rotation[:, 2], self._centre)
        weight = c.model.gravity * float(self._mass @ height)
        springs = self._springs(np.repeat(rotation[self._cars, 2, 2], 4), np.repeat(q[self._cars, 2], 4), rotation)
        return kinetic, kinetic + weight + springs - self.tread_work, float(speed[self._cars].max())

    def _springs(self, upright: np.ndarray, height: np.ndarray, rotation: np.ndarray) -> float:
        """Energy of springs and stops of all wheels.

        What they can give back: the ground's force is the load times the cosine of the inclination, on a way that is
        shorter than the travel of the wheel by the same factor (`upright`).
        """
        c = self.compiled
        wheels, compression = c.model.wheels, c.state.wheel_compression
        high, stiffness = wheels["compression_max"], wheels["stiffness"]
        static = wheels["sprung_mass"] * c.model.gravity * upright
        free = np.maximum(-static / stiffness, -wheels["droop_max"])
        travel = np.clip(compression, free, high)
        spring = upright**2 * (static * (travel - free) + 0.5 * stiffness * (travel**2 - free**2))
        hub = height + np.einsum("wj,wj->w", np.repeat(rotation[self._cars, 2], 4, axis=0), wheels["hub"])
        depth = np.maximum(0.0, upright * (compression - high))
        full = upright * (static + stiffness * high) * depth
        centre, end = hub + high * upright, wheels["radius"] * upright
        rim = np.maximum(0.0, np.array([end, -end]) - centre)  # depths of both ends of its diameter
        stop = 0.5 * wheels["bump_stiffness"]
        lying = (stop * rim**2).sum(axis=0)
        return float(np.where(upright > 0.1, spring + full + stop * depth**2, lying).sum())


def jam(vehicle: str, seed: int, folder: Path) -> Jam:
    """Drives 3 to 7 cars into each other: nose to nose, into walls or through boxes, some with reversed throttle later.

    RoboRacers start at up to 8 m/s. Raises `EngineError` if the physics becomes unstable.
    """
    rng = np.random.default_rng(seed)
    count, arena = 3 + seed % 5, ARENAS[seed // 5 % len(ARENAS)]
    is_racer = vehicle.startswith("roboracer")
    world = _world(vehicle, count, arena, rng, folder)
    if is_racer:
        _roll(world, float(rng.uniform(0.5, 8.0)) * rng.uniform(0.6, 1.0, count))
    seconds = 1.5 if is_racer else 4.0
    reversal = rng.uniform(0.3, 1.0) * seconds if rng.random() < 0.4 else math.inf
    names = world.vehicle_names
    throttle = dict(zip(names, rng.choice([0.6, 1.0, 1.0], count).tolist(), strict=True))
    steering = dict(zip(names, rng.uniform(-0.6, 0.6, count).tolist(), strict=True))
    commands = [{n: Command(throttle=s * throttle[n], steering=steering[n]) for n in names} for s in (1.0, -1.0)]
    energy = Energy(world)
    start = most = energy.now()[0]
    least, gain, excess, top_speed, load = math.inf, 0.0, 0.0, 0.0, 0.0
    static = world.compiled.model.wheels["sprung_mass"] * world.compiled.model.gravity
    for tick in range(round(seconds / SUBSTEP)):
        world.step(commands[tick * SUBSTEP > reversal] if tick % 100 == 0 else None)
        energy.observe_substep()
        kinetic, rest, speed = energy.now()
        most, least, top_speed = max(most, kinetic), min(least, rest), max(top_speed, speed)
        gain = max(gain, (rest - least) / (most + 0.01))
        excess = max(excess, kinetic / (start + energy.motor_work + 0.01))
        load = max(load, float((world.compiled.state.wheel_normal_load / static).max()))
    return Jam(top_speed=top_speed, gain=gain, excess=excess, load=load)


def _world(vehicle: str, count: int, arena: str, rng: np.random.Generator, folder: Path) -> World:
    """The cars stand on a circle and look at its middle."""
    spec = load_vehicle(vehicle)
    length, width, _ = spec.size
    nose = 0.5 * (length + spec.wheelbase) + 0.05  # from the rear axle
    inner = max(0.25, 1.6 * width * count / (2.0 * math.pi))
    vehicles = {}
    for i in range(count):
        bearing = 2.0 * math.pi * (i + rng.uniform(-0.1, 0.1)) / count
        radius = inner * rng.uniform(1.0, 1.3) + nose
        yaw = bearing + math.pi + rng.uniform(-0.25, 0.25)
        vehicles[f"V{i + 1}"] = VehiclePlacement(
            type=vehicle, x=radius * math.cos(bearing), y=radius * math.sin(bearing), yaw_deg=math.degrees(yaw)
        )
    boxes = {}
    if arena == "boxes":
        edge = 0.08
        for x, y in ((edge, 0.0), (-edge, 0.0), (0.0, edge), (0.0, -edge)):
            boxes[f"box_{len(boxes)}"] = BoxSpec(
                x=x, y=y, size=(edge, edge, 0.1), yaw_deg=45.0, mass=float(rng.choice([0.1, 0.3, 1.0]))
            )
    map_ = _walled(inner + nose + length, folder) if arena == "walls" else "plane"
    return autodrive.make(ScenarioSpec(map=map_, vehicles=vehicles, boxes=boxes, tick=SUBSTEP))


def _walled(size: float, folder: Path) -> str:
    """Path of a map with a block in the middle of four walls at that distance [m]."""
    file = folder / f"walls_{size:.4f}.yaml"
    corners = [[size, size], [-size, size], [-size, -size], [size, -size]]
    tree = {
        "title": "Walls",
        "ground": {"length": 20.0, "width": 20.0},
        "paved": [{"shape": "rectangle", "length": 20.0, "width": 20.0}],
        "walls": [{"points": corners, "is_closed": True, "thickness": 0.05, "height": 0.3}],
        "blocks": [{"x": 0.0, "y": 0.0, "yaw_deg": 20.0, "length": 0.2, "width": 0.1, "height": 0.2}],
    }
    file.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(file)


def _roll(world: World, speeds: np.ndarray) -> None:
    """Lets the cars roll at these speeds [m/s]."""
    c = world.compiled
    for i, speed in enumerate(speeds.tolist()):
        forward = world.frame.vehicles[world.vehicle_names[i]].pose.orientation
        yaw = 2.0 * math.atan2(forward[3], forward[0])
        dof = int(c.model.vehicles[i]["dof"])
        c.state.qvel[dof : dof + 2] = speed * math.cos(yaw), speed * math.sin(yaw)
        c.state.wheel_angular_velocity[4 * i : 4 * i + 4] = speed / c.model.wheels[4 * i]["radius"]
    place(c.model, c.state, c.views)


# -- corners ----------------------------------------------------------------------------------------------------

CORNERS = ("walls", "ducts", "wedge", "slot", "boxes")
"""Two walls or air ducts that meet; blocks that come together, or are a little narrower apart than the car; boxes that
the car pushes against a wall."""
FREE, PATIENCE = 0.1, 4.0
"""How far a car must get out of a corner [m], and how long it may take [s]."""


class CornerJam(NamedTuple):
    """What happened to a car that was driven into a corner and out of it."""

    gain: float
    """As in `Jam`; likewise the next one."""
    excess: float
    crash_depth: float
    """Largest depth of a contact of the car with what is fixed [m]."""
    push_depth: float
    """Likewise, in the last quarter of a second before the throttle is reversed."""
    rise: float
    """Largest height of the rear axle above where it was at the start [m]."""
    time_to_free: float
    """From the reversal of the throttle until the car was `FREE` from there [s]; infinity: it was not in `PATIENCE`."""


def corner_jam(vehicle: str, seed: int, folder: Path) -> CornerJam:
    """Drives a car into a corner at full throttle with random steering, and then straight backwards out of it.

    RoboRacers start at up to 8 m/s. Raises `EngineError` if the physics becomes unstable.
    """
    rng = np.random.default_rng(seed)
    kind = CORNERS[seed % len(CORNERS)]
    spec = load_vehicle(vehicle)
    is_racer = vehicle.startswith("roboracer")
    length, width, _ = spec.size
    angle = float(rng.uniform(0.6, 2.6))
    map_, boxes = _corner(kind, angle, rng, width, folder / f"corner_{vehicle}_{seed}.yaml")
    bearing = float(rng.uniform(-0.2, 0.2))
    mouth = (width + 0.2) / math.tan(angle / 2.0) if kind in ("walls", "ducts") else 0.15
    way = length + mouth + float(rng.uniform(0.02, 0.2))
    start = VehiclePlacement(
        type=vehicle, x=-way * math.cos(bearing), y=-way * math.sin(bearing), yaw_deg=math.degrees(bearing)
    )
    world = autodrive.make(ScenarioSpec(map=map_, vehicles={"V1": start}, boxes=boxes, tick=SUBSTEP))
    if is_racer:
        _roll(world, np.array([rng.uniform(0.0, 8.0)]))
    pushes = round((1.0 if is_racer else 2.0) / SUBSTEP)
    turns = rng.uniform(-spec.steering.limit, spec.steering.limit, 4)
    c, energy = world.compiled, Energy(world)
    first, height = energy.now()[0], float(c.state.vehicle_position[0, 2])
    most, least = first, math.inf
    gain = excess = crash = push = rise = 0.0
    place_of_reversal = np.zeros(3)
    for tick in range(pushes + round(PATIENCE / SUBSTEP)):
        turn = float(turns[4 * tick // pushes]) if tick < pushes else 0.0
        command = Command(throttle=1.0 if tick < pushes else -1.0, steering=turn)
        world.step({"V1": command} if tick % 50 == 0 else None)
        energy.observe_substep()
        if tick % 4 == 0:
            kinetic, rest, _ = energy.now()
            most, least = max(most, kinetic), min(least, rest)
            gain = max(gain, (rest - least) / (most + 0.01))
            excess = max(excess, kinetic / (first + energy.motor_work + 0.01))
        depth = _depth(world)
        crash = max(crash, depth)
        rise = max(rise, float(c.state.vehicle_position[0, 2]) - height)
        if pushes - 250 <= tick < pushes:
            push = max(push, depth)
        if tick == pushes:
            place_of_reversal = c.state.vehicle_position[0].copy()
        elif tick > pushes and np.linalg.norm(c.state.vehicle_position[0] - place_of_reversal) > FREE:
            return CornerJam(gain, excess, crash, push, rise, (tick - pushes) * SUBSTEP)
    return CornerJam(gain, excess, crash, push, rise, math.inf)


def _depth(world: World) -> float:
    """Of the deepest contact of the car with a fixed shape [m]; the floor is none."""
    c = world.compiled
    if not c.views.contact_count[0]:
        return 0.0
    contact = c.engine.data.contact
    solids = c.views.slots.solid[contact.geom]
    is_fixed = (solids[:, 0] > 0) & (solids[:, 0] <= c.model.shapes.n_fixed)
    return float(max(0.0, -contact.dist[is_fixed].min(initial=0.0)))


def _corner(
    kind: str, angle: float, rng: np.random.Generator, width: float, file: Path
) -> tuple[str, dict[str, BoxSpec]]:
    """Path of a map with a corner at the origin that is open towards -x, and the boxes in it.

    `angle`: between its sides [rad]; `width`: of the car [m].
    """
    ends = [(-3.0 * math.cos(side * angle / 2.0), 3.0 * math.sin(side * angle / 2.0)) for side in (1.0, -1.0)]
    boxes: dict[str, BoxSpec] = {}
    tree: dict[str, Any] = {"title": "Corner", "ground": {"length": 20.0, "width": 20.0}}
    tree["paved"] = [{"shape": "rectangle", "length": 20.0, "width": 20.0}]
    if kind == "ducts":
        corners = [(0.0, 0.0), ends[0], (-9.0, 3.0), (-9.0, -3.0), ends[1]]
        if angle > 2.0:
            corners = [(0.0, 0.0), ends[0], (-9.0, ends[0][1]), (-9.0, ends[1][1]), ends[1]]
        tree = {
            "title": "Corner",
            "barrier": {"kind": "duct", "width": 0.33, "height": 0.33, "length": 1.0, "gap": 0.03},
            "centre_line": ["-5 0 0.3 0.3", "-5.5 -0.5 0.3 0.3", "-6 0 0.3 0.3", "-5.5 0.5 0.3 0.3"],
            "walls": [[f"{x:.4f} {y:.4f}" for x, y in corners]],
        }
    elif kind == "walls":
        points = [list(ends[0]), [0.0, 0.0], list(ends[1])]
        tree["walls"] = [{"points": points, "thickness": float(rng.uniform(0.02, 0.2)), "height": 0.3}]
    elif kind == "boxes":
        tree["walls"] = [{"points": [[0.1, 3.0], [0.1, -3.0]], "thickness": 0.1, "height": 0.3}]
        for k in range(4):
            size = rng.uniform(0.04, 0.15, 3).tolist()
            boxes[f"box_{k}"] = BoxSpec(x=-0.1, y=0.25 * k - 0.375, size=(size[0], size[1], size[2]), mass=0.2)
    else:
        gap = float(rng.uniform(0.7, 0.98)) * width
        turn = float(rng.uniform(2.0, 20.0)) if kind == "wedge" else 0.0
        tree["blocks"] = [
            {
                "x": 0.5,
                "y": side * (gap / 2.0 + 0.5),
                "yaw_deg": side * -turn,
                "length": 1.0,
                "width": 1.0,
                "height": 0.3,
            }
            for side in (1.0, -1.0)
        ]
    file.write_text(yaml.safe_dump(tree), encoding="utf-8")
    return str(file), boxes
