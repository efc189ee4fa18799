"""Contacts against closed forms: friction, turned worlds, impacts on walls, crashes at any speed, lying cars."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of MuJoCo have no types)

import itertools
import math
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import pytest

import autodrive
from autodrive import Collision, Command
from autodrive.base.arrays import Floats
from autodrive.base.transforms import quaternion_from_euler, rotation_from_quaternion
from autodrive.physics.tick import place
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.batch import BatchWorld
from tests.support.cars import car_file
from tests.support.hardening import cases
from tests.support.jams import Energy
from tests.support.maps import map_file

G = 9.81
HEADINGS = (0, 10, 37, 45, 90, 123, 180, 211, 270, 300, 345)
"""Eleven angles [degrees]: along the axes, between them, and others."""


def wall(*points: tuple[float, float], name: str = "wall") -> dict[str, Any]:
    return {"name": name, "points": [list(point) for point in points], "thickness": 0.05, "height": 0.3}


def roll(world: World, vehicle: int, speed: float, heading: float) -> None:
    """Lets a vehicle roll with that speed [m/s] and heading [rad]."""
    c = world.compiled
    dof = int(c.model.vehicles[vehicle]["dof"])
    c.state.qvel[dof : dof + 2] = speed * math.cos(heading), speed * math.sin(heading)
    wheels = slice(4 * vehicle, 4 * vehicle + 4)
    c.state.wheel_angular_velocity[wheels] = speed / c.model.wheels["radius"][wheels]
    place(c.model, c.state, c.views)


# -- directions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("heading", HEADINGS)
def test_a_box_slides_as_far_in_each_direction_as_friction_lets_it(heading: int) -> None:
    """v^2 / (2 mu g), straight on. With a pyramid of friction: up to 119.6 mm, and up to 12.7 degrees off."""
    world = autodrive.make(
        ScenarioSpec(vehicles={"V1": VehiclePlacement(x=-3.0)}, boxes={"box": BoxSpec(x=0.0, y=0.0, mass=0.5)})
    )
    for _ in range(30):
        world.step()
    c, start = world.compiled, np.array(world.frame.objects["box"].pose.position)
    dof, angle = c.engine.body("box")[2], math.radians(heading)
    c.state.qvel[dof : dof + 2] = math.cos(angle), math.sin(angle)
    place(c.model, c.state, c.views)
    for _ in range(60):
        world.step()
    way = np.array(world.frame.objects["box"].pose.position) - start
    assert math.hypot(way[0], way[1]) == pytest.approx(1.0 / (2.0 * 0.6 * G), rel=0.01)
    assert abs(math.remainder(math.atan2(way[1], way[0]) - angle, math.tau)) < math.radians(0.05)


@pytest.mark.parametrize("heading", [0, 10, 37, 45])
def test_a_car_pushes_a_box_straight_on_at_each_heading(heading: int) -> None:
    """With a pyramid of friction the box was 0.45 m aside at 10 degrees, and turned by 36 degrees."""
    angle = math.radians(heading)
    ahead = np.array([math.cos(angle), math.sin(angle)])
    box = BoxSpec(x=0.5 * ahead[0], y=0.5 * ahead[1], yaw_deg=heading, mass=0.5)
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(yaw_deg=heading)}, boxes={"box": box}))
    for _ in range(300):
        world.step({"V1": Command(throttle=1.0)})
    x, y, _ = world.frame.objects["box"].pose.position.tolist()
    assert x * ahead[0] + y * ahead[1] > 1.2
    assert abs(y * ahead[0] - x * ahead[1]) < 1e-6


class Placed(NamedTuple):
    """How a scene is placed: turned by an angle [rad], moved [m], and mirrored at the x axis before."""

    angle: float
    x: float
    y: float
    is_mirrored: bool

    @property
    def side(self) -> float:
        """Sign of the lateral axis."""
        return -1.0 if self.is_mirrored else 1.0

    def place(self, x: float, y: float) -> tuple[float, float]:
        c, s = math.cos(self.angle), math.sin(self.angle)
        return c * x - s * self.side * y + self.x, s * x + c * self.side * y + self.y

    def heading(self, degrees: float) -> float:
        return self.side * degrees + math.degrees(self.angle)

    def back(self, position: Any) -> list[float]:
        """The position in the scene as it was before."""
        c, s = math.cos(self.angle), math.sin(self.angle)
        x, y = position[0] - self.x, position[1] - self.y
        return [c * x + s * y, self.side * (c * y - s * x), position[2]]


def scene(frame: Placed, types: tuple[str, str], speed: float, folder: Path) -> World:
    """Two cars that drive into each other, three boxes, a wall with a corner and a block."""
    x, y = frame.place(0.9, -0.5)
    block = {"x": x, "y": y, "yaw_deg": frame.heading(20.0), "length": 0.2, "width": 0.1, "height": 0.2}
    corner = wall(frame.place(1.2, -1.5), frame.place(1.2, 0.4), frame.place(0.8, 1.5))
    vehicles = {}
    for number, (kind, pose) in enumerate(zip(types, ((0.0, 0.0, 4.0), (0.2, 0.45, -25.0)), strict=True), 1):
        x, y = frame.place(*pose[:2])
        vehicles[f"V{number}"] = VehiclePlacement(type=kind, x=x, y=y, yaw_deg=frame.heading(pose[2]))
    boxes = {}
    for number, pose in enumerate(((0.55, 0.02, 10.0), (0.72, 0.13, 40.0), (0.68, -0.2, -5.0))):
        x, y = frame.place(*pose[:2])
        boxes[f"box_{number}"] = BoxSpec(x=x, y=y, yaw_deg=frame.heading(pose[2]), mass=0.2)
    map_ = map_file(folder, walls=[corner], blocks=[block])
    world = autodrive.make(ScenarioSpec(map=map_, vehicles=vehicles, boxes=boxes))
    for number, vehicle in enumerate(vehicles.values()):
        roll(world, number, speed, math.radians(vehicle.yaw_deg))
    return world


def commands(frame: Placed) -> dict[str, Command]:
    return {"V1": Command(1.0, 0.1 * frame.side), "V2": Command(1.0, -0.2 * frame.side)}


def path(world: World, frame: Placed) -> tuple[Floats, int]:
    """Where all bodies are after each tick of a second, in the scene as it was before, and the number of collisions."""
    poses, collisions = [], 0
    for _ in range(100):
        now = world.step(commands(frame))
        bodies = [*now.vehicles.values(), *now.objects.values()]
        poses.append([frame.back(body.pose.position) for body in bodies])
        collisions += sum(isinstance(event, Collision) for event in now.events)
    return np.array(poses), collisions


@pytest.mark.parametrize(
    ("types", "speed", "most"),
    [(("nigel", "nigel"), 0.0, 1e-6), (("roboracer_physical", "roboracer_f1tenth"), 1.0, 3e-4)],
    ids=["nigels", "racers"],
)
def test_a_turned_moved_and_mirrored_world_has_the_same_paths(
    types: tuple[str, str], speed: float, most: float, tmp_path: Path
) -> None:
    """Within 1e-6 m during a second; contacts of the faster cars amplify the last bits of the poses."""
    upright = Placed(0.0, 0.0, 0.0, False)
    expected, collisions = path(scene(upright, types, speed, tmp_path), upright)
    assert collisions > 3
    assert (np.abs(expected[-1] - expected[0]).max(axis=1) > 0.05).sum() > 3
    for number, heading in enumerate(HEADINGS):
        moved = (3.7, -2.2) if number % 3 == 1 else (0.0, 0.0)
        frame = Placed(math.radians(heading), *moved, number % 3 == 2)
        error = np.abs(path(scene(frame, types, speed, tmp_path), frame)[0] - expected).max()
        assert error < most, (heading, moved, frame.is_mirrored)


def test_a_turned_batch_has_the_same_paths(tmp_path: Path) -> None:
    types = ("nigel", "nigel")
    upright, turned = Placed(0.0, 0.0, 0.0, False), Placed(0.65, 1.0, 2.0, False)
    ends = []
    for frame in (upright, turned):
        world = scene(frame, types, 0.0, tmp_path)
        batch = BatchWorld(world.spec, 2)
        batch.step([[[1.0, 0.1], [1.0, -0.2]]] * 2, ticks=100)
        ends.append([frame.back(pose[:3]) for pose in batch.worlds.state.qpos[1].reshape(-1, 7).tolist()])
    np.testing.assert_allclose(ends[1], ends[0], rtol=0.0, atol=1e-6)


# -- impacts on a wall -------------------------------------------------------------------------------------------


class Motion(NamedTuple):
    """Motion of the centre of mass of a vehicle, map axes."""

    rotation: Floats
    centre: Floats
    velocity: Floats
    turn: Floats

    @classmethod
    def of(cls, world: World) -> "Motion":
        c = world.compiled
        v = c.model.vehicles[0]
        q, d = int(v["qpos"]), int(v["dof"])
        rotation = np.array(rotation_from_quaternion(tuple(c.state.qpos[q + 3 : q + 7].tolist()))).reshape(3, 3)
        turn, arm = rotation @ c.state.qvel[d + 3 : d + 6], rotation @ v["center_of_mass"]
        by_turn: Any = np.cross(turn, arm)
        return cls(rotation, c.state.qpos[q : q + 3] + arm, c.state.qvel[d : d + 3] + by_turn, turn)


def impact(motion: Motion, place_: Floats, mass: float, inertia: Floats, friction: float) -> tuple[Floats, Floats]:
    """Velocity and angular velocity after an inelastic impact at a point of a wall with the normal -y.

    Routh's method: the impulse along the normal grows from 0 until nothing approaches; friction acts against the slip
    of each moment, and holds if it can (Stronge, Impact Mechanics, chapter 4).
    """
    normal = np.array([0.0, -1.0, 0.0])
    x, y, z = arm = place_ - motion.centre
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    inverse = motion.rotation @ np.diag(1.0 / inertia) @ motion.rotation.T
    response = np.eye(3) / mass - cross @ inverse @ cross
    velocity, total = motion.velocity + np.cross(motion.turn, arm), np.zeros(3)
    step = 1e-4 * mass * abs(float(velocity @ normal))
    for _ in range(100_000):
        if velocity @ normal >= 0.0:
            break
        slip = velocity - (velocity @ normal) * normal
        speed = float(np.linalg.norm(slip))
        held = np.linalg.solve(response, normal)
        held /= held @ normal
        along = held - normal
        if speed > 1e-3:
            part = normal - friction * slip / speed
        elif np.linalg.norm(along) > friction:
            part = normal + friction * along / np.linalg.norm(along)
        else:
            part = held
        total += step * part
        velocity = velocity + response @ (step * part)
    return motion.velocity + total / mass, motion.turn + inverse @ np.cross(arm, total)


def hit(world: World, speed: float) -> tuple[Motion, Floats, Motion]:
    """Motion before the tick of the impact, its deepest contact [m], and motion after the tick."""
    while True:
        before = Motion.of(world)
        frame = world.step({"V1": Command(throttle=speed / 22.0)})
        if any(isinstance(event, Collision) for event in frame.events):
            break
        assert world.time < 3.0
    contact = world.compiled.engine.data.contact
    return before, contact.pos[contact.dist.argmin()].copy(), Motion.of(world)


@pytest.mark.parametrize("degrees", [2, 6, 12, 20, 30, 45, 70, 75, 85])
@pytest.mark.parametrize("speed", [3.0, 8.0])
def test_an_impact_on_a_wall_has_the_closed_form_of_a_rigid_body(degrees: int, speed: float, tmp_path: Path) -> None:
    """Rebound, loss of speed and spin. Before, a race car that grazed a wall stopped dead at 6, 8 and 12 degrees."""
    angle = math.radians(degrees)
    map_ = map_file(tmp_path, walls=[wall((-9.0, 0.025), (9.0, 0.025))])
    pose = {"x": -0.9 * math.cos(angle), "y": -0.9 * math.sin(angle) - 0.16, "yaw_deg": degrees}
    car = car_file(
        tmp_path, {"body.angular_velocity_max": 100.0}, "roboracer_physical"
    )  # Unity's limit would stop the spin
    world = autodrive.make(ScenarioSpec(map=map_, vehicles={"V1": VehiclePlacement(type=car, **pose)}, tick=0.001))
    roll(world, 0, speed, angle)
    before, where, after = hit(world, speed)
    v = world.compiled.model.vehicles[0]
    velocity, turn = impact(before, where, float(v["mass"]), v["inertia"], 0.5 * (0.6 + 0.4))
    # the tyres act as well, and beyond 45 degrees both ends of an edge of the bumper touch
    assert np.abs(after.velocity - velocity)[:2].max() < 0.04 * speed
    assert abs(after.turn[2] - turn[2]) < 0.1 * abs(turn[2]) + 0.22 * speed  # 0.05 of the speed at the rims


@pytest.mark.parametrize("degrees", [6, 8, 12])
def test_a_race_car_that_grazes_a_wall_slides_on(degrees: int, tmp_path: Path) -> None:
    map_ = map_file(tmp_path, walls=[wall((-9.0, 0.025), (30.0, 0.025))])
    pose = {"x": -0.9, "y": -0.9 * math.tan(math.radians(degrees)) - 0.16, "yaw_deg": degrees}
    world = autodrive.make(ScenarioSpec(map=map_, vehicles={"V1": VehiclePlacement(type="roboracer", **pose)}))
    roll(world, 0, 3.0, math.radians(degrees))
    slowest = 3.0
    for _ in range(200):
        slowest = min(slowest, world.step({"V1": Command(throttle=3.0 / 22.0)}).vehicles["V1"].speed)
    assert world.frame.vehicles["V1"].collision_count > 0
    assert slowest > 2.3


@pytest.mark.parametrize(
    ("body", "side", "ground"), [*itertools.product((0.0, 0.8), (None,), (0.0, 0.3, 0.6)), (0.4, 1.0, 0.2)]
)
def test_friction_of_wheel_and_wall_act_with_their_mean(
    body: float, side: float | None, ground: float, tmp_path: Path
) -> None:
    """Loss of speed along the wall per speed that the wall takes, while the wheel slides on it."""
    changes = {"body.friction": body} | ({} if side is None else {"wheels.side_friction": side})
    car = car_file(tmp_path, changes, "roboracer")
    tree = {"length": 60.0, "width": 60.0, "friction": ground}
    map_ = map_file(tmp_path, ground=tree, walls=[wall((-9.0, 0.025), (9.0, 0.025))])
    start = VehiclePlacement(type=car, x=-0.9, y=-0.9 * math.tan(math.radians(20.0)) - 0.16, yaw_deg=20.0)
    world = autodrive.make(ScenarioSpec(map=map_, vehicles={"V1": start}, tick=0.001))
    roll(world, 0, 5.0, math.radians(20.0))
    before, _, after = hit(world, 5.0)
    lost = before.velocity - after.velocity
    expected = 0.5 * (ground + (body if side is None else side))
    assert lost[1] > 0.5
    assert lost[0] / lost[1] == pytest.approx(expected, abs=0.06)


# -- crashes -----------------------------------------------------------------------------------------------------

TOP_SPEEDS = {"nigel": 0.44, "nigel_2020": 0.4, "nigel_2023": 0.3}
TOP_SPEEDS |= {"roboracer": 22.0, "roboracer_physical": 22.0, "roboracer_f1tenth": 20.0}
"""Of the included vehicles [m/s]."""


def crash(seed: int, folder: Path) -> tuple[World, str]:
    """A world shortly before a random crash: into another car, a wall, or the gap between two walls."""
    rng = np.random.default_rng(seed)
    kind = ("car", "wall", "gap")[seed % 3]
    racers = list(TOP_SPEEDS)[3:]
    first = str(rng.choice(racers if rng.random() < 0.7 else list(TOP_SPEEDS)))
    speeds = [TOP_SPEEDS[first] * float(rng.uniform(0.1, 1.0))]
    map_ = "plane"
    if kind == "car":
        second = str(rng.choice(list(TOP_SPEEDS)))
        speeds.append(TOP_SPEEDS[second] * float(rng.choice([0.0, rng.uniform(0.0, 1.0)])))
        bearing, heading = rng.uniform(-math.pi, math.pi, 2).tolist()
        time, aim = 1.2 / max(speeds[0], 0.1), rng.uniform(-0.15, 0.15, 2)
        pose = [-1.2 * math.cos(bearing) + aim[0], -1.2 * math.sin(bearing) + aim[1], math.degrees(bearing)]
        other = [-speeds[1] * time * math.cos(heading), -speeds[1] * time * math.sin(heading), math.degrees(heading)]
        if math.hypot(pose[0] - other[0], pose[1] - other[1]) < 1.0:
            other[:2], speeds[1] = (0.0, 0.0), 0.0
        placements = {"V1": (first, pose), "V2": (second, other)}
    elif kind == "wall":
        angle = float(rng.uniform(-80.0, 80.0))
        map_ = map_file(folder, walls=[wall((0.0, -8.0), (0.0, 8.0))])
        placements = {"V1": (first, [-1.0, -math.tan(math.radians(angle)), angle])}
    else:
        half = 0.5 * float(rng.choice([0.2, 0.22, 0.24, 0.26, 0.28, 0.3])) + 0.025
        sides = [wall((0.0, y), (5.0, y), name=name) for y, name in ((half, "left"), (-half, "right"))]
        map_ = map_file(folder, walls=sides)
        placements = {"V1": (first, [-1.0, float(rng.uniform(-0.05, 0.05)), float(rng.uniform(-5.0, 5.0))])}
    vehicles = {
        name: VehiclePlacement(type=vehicle, x=float(x), y=float(y), yaw_deg=float(yaw))
        for name, (vehicle, (x, y, yaw)) in placements.items()
    }
    world = autodrive.make(ScenarioSpec(map=map_, vehicles=vehicles, tick=0.002))
    for number, (vehicle, speed) in enumerate(zip(vehicles.values(), speeds, strict=True)):
        roll(world, number, speed, math.radians(vehicle.yaw_deg))
    return world, kind


def overlaps(world: World) -> list[tuple[str, str]]:
    """Pairs, without the floor, that are more than 1 mm deep in each other."""
    c = world.compiled
    pairs = c.engine.overlapping(c.state.qpos.copy(), depth=0.001)
    return [(c.owners[a], c.owners[b]) for a, b in pairs if a and b]


@pytest.mark.slow
@pytest.mark.parametrize("group", range(4))
def test_after_any_crash_nothing_is_in_each_other_and_throttle_parts_it(group: int, tmp_path: Path) -> None:
    """AUTODRIVE_HARDENING=long: 1,000 crashes instead of 48. Before, one in 20 cars stuck in what it had hit."""
    hits = standing = parted = 0
    for seed in cases(range(12), range(250)):
        world, kind = crash(1000 * group + seed, tmp_path)
        names, end = world.vehicle_names, math.inf
        while world.time < min(end, 4.0):
            frame = world.step({name: Command() for name in names})
            if end == math.inf and any(isinstance(event, Collision) for event in frame.events):
                end = world.time + 0.5
        if end == math.inf:
            continue
        hits += 1
        assert not overlaps(world), (group, seed, kind)
        x, y = world.pose("V1")[:2]
        c = world.compiled
        upright = rotation_from_quaternion(tuple(c.state.qpos[int(c.model.vehicles[0]["qpos"]) + 3 :][:4].tolist()))[8]
        if upright < 0.9:  # it lies on its side or on its roof
            continue
        standing += 1
        for throttle in (-1.0, 1.0):
            for _ in range(500):
                world.step({"V1": Command(throttle=throttle)})
                if math.dist(world.pose("V1")[:2], (x, y)) > 0.05:
                    break
        parted += math.dist(world.pose("V1")[:2], (x, y)) > 0.05
    print(f"\n{hits} crashes; {parted} of {standing} cars on their wheels part by throttle")
    assert standing > 0.3 * hits > 0
    assert parted > 0.99 * standing  # a car can be wedged between two walls


# -- on its side and on its roof --------------------------------------------------------------------------------


def dropped(vehicle: str, roll: float, pitch: float) -> World:
    """A world with a car that is turned by these angles [degrees], 2 cm above the floor; a tick is one substep."""
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, tick=0.001))
    c = world.compiled
    car, wheels = c.model.vehicles[0], c.model.wheels
    orientation = quaternion_from_euler(math.radians(roll), math.radians(pitch), 0.3)
    up = np.array(rotation_from_quaternion(orientation)[6:])
    chassis = np.array([*itertools.product(*zip(car["chassis_low"], car["chassis_high"], strict=True))]) @ up
    rims = wheels["hub"] @ up + wheels["compression_max"] * up[2] - wheels["radius"] * math.hypot(up[0], up[2])
    qpos = int(car["qpos"])
    c.state.qpos[qpos : qpos + 3] = 0.0, 0.0, 0.02 - min(chassis.min(), rims.min())
    c.state.qpos[qpos + 3 : qpos + 7] = orientation
    place(c.model, c.state, c.views)
    return world


@pytest.mark.parametrize("vehicle", ["roboracer", "roboracer_f1tenth", "nigel"])
@pytest.mark.parametrize(
    ("roll", "pitch"),
    [(90, 0), (85, 5), (100, 0), (95, -10), (-90, 3), (180, 0), (-170, 5)],
)
def test_a_car_on_its_side_or_its_roof_comes_to_rest(vehicle: str, roll: float, pitch: float) -> None:
    """Without a gain of energy. On rims with one point each, race cars rolled at 0.26 rad/s for ever."""
    world = dropped(vehicle, roll, pitch)
    c, energy = world.compiled, Energy(world)
    least = start = energy.now()[1]
    motion = np.zeros((200, 6))
    for tick in range(4000):
        world.step()
        energy.observe_substep()
        motion[tick % len(motion)] = c.state.qvel
        if tick % 4 == 0:
            present = energy.now()[1]
            assert present - least < 0.02 * start, tick
            least = min(least, present)
    assert np.linalg.norm(motion[:, :3], axis=1).max() < 1e-4
    assert np.linalg.norm(motion[:, 3:], axis=1).max() < 0.005


@pytest.mark.parametrize("vehicle", ["roboracer_physical", "roboracer_f1tenth"])
def test_a_race_car_lies_on_two_rims_with_the_tilt_at_which_moments_balance(vehicle: str) -> None:
    """Per tilt, the stops k at both ends of the diameters 2 R of two rims turn with 4 k R^2 against the weight W, whose
    centre is at the height h: W e / (4 k R^2 - W h)."""
    world = dropped(vehicle, 90.0, 0.0)
    for _ in range(4000):
        world.step()
    c = world.compiled
    car, wheel = c.model.vehicles[0], c.model.wheels[0]
    weight = float(car["mass"]) * G
    assert c.state.wheel_normal_load.sum() == pytest.approx(weight, rel=1e-3)
    offset = float(car["center_of_mass"][2] - wheel["compression_max"])  # of the weight from the middle of the rims
    stiffness = 4.0 * float(wheel["bump_stiffness"] * wheel["radius"] ** 2)
    tilt = weight * offset / (stiffness - weight * float(wheel["hub"][1]))
    qpos = int(car["qpos"])
    upright = rotation_from_quaternion(tuple(c.state.qpos[qpos + 3 : qpos + 7].tolist()))[8]
    assert upright == pytest.approx(-tilt, rel=0.005)


# -- values of the engine ----------------------------------------------------------------------------------------

VIEWER, UNUSED = "only for the engine's own viewer", "the worlds have nothing of this kind"
KEPT_OF_GEOMS = {
    "adhesion": "nothing sticks",
    "castshadow": VIEWER,
    "condim": "3: friction in two directions, as CLASSES says",
    "contype": "1 is the class of the floor",
    "dataid": UNUSED,
    "fluid": UNUSED,
    "gap": "0 at the start; each step sets what a body can reach in it",
    "group": VIEWER,
    "matid": VIEWER,
    "plugin": UNUSED,
    "priority": "no geom decides alone about the friction of a contact",
    "rgba": VIEWER,
    "solmix": "1 for walls and vehicles, whose contacts are the same; floor and boxes have others",
    "surfacevel": "no conveyor belts",
    "user": UNUSED,
}
KEPT_OPTIONS = {
    "density": "air drag is our own",
    "disableactuator": UNUSED,
    "gravity": "that of the scenario, which is the engine's",
    "impratio": "1: friction as stiff as the normal; 10 changes a slide by 0.2 %",
    "integrator": "semi-implicit Euler, as `free_body.py`",
    "iterations": "100, of which a step needs 5",
    "jacobian": "dense or sparse by the number of bodies",
    "ls_iterations": "50",
    "ls_tolerance": "0.01; 1e-14 for both tolerances changes no digit of a slide",
    "magnetic": UNUSED,
    "noslip_iterations": "none: a box on the floor does not creep",
    "noslip_tolerance": UNUSED,
    "o_friction": UNUSED,
    "o_margin": UNUSED,
    "o_solimp": UNUSED,
    "o_solref": UNUSED,
    "sdf_initpoints": UNUSED,
    "sdf_iterations": UNUSED,
    "sleep_tolerance": "1 mm/s: slower bodies fall asleep",
    "solver": "Newton, the most precise",
    "tolerance": "1e-8; 1e-14 for both tolerances changes no digit of a slide",
    "viscosity": "air drag is our own",
    "wind": "air drag is our own",
}
"""Values that some geom of a world has from the engine's defaults, and such options -> why."""
PLACES = {"aabb", "bodyid", "pos", "quat", "sameframe", "type"}
"""Columns of geoms that follow from their shapes and places."""


def test_the_values_of_every_geom_are_set_on_purpose() -> None:
    """All values of the compiled model that are the engine's defaults stand in the tables above, with a reason."""
    vehicles = {name: VehiclePlacement(type=name, x=0.7 * k - 1.0) for k, name in enumerate(TOP_SPEEDS)}
    world = autodrive.make(ScenarioSpec(map="tiny_town", vehicles=vehicles))  # with boxes of its own
    model = world.compiled.engine.model
    plain = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>"
    )
    kept = set()
    for name in dir(plain):
        default = getattr(plain, name) if name.startswith("geom_") else None
        if isinstance(default, np.ndarray) and len(default) == 1:
            values = getattr(model, name)
            if any(np.array_equal(values[row], default[0]) for row in range(model.ngeom)):
                kept.add(name.removeprefix("geom_"))
    assert kept - PLACES == set(KEPT_OF_GEOMS)
    options = [name for name in dir(plain.opt) if not name.startswith("_")]
    same = {name for name in options if np.array_equal(getattr(model.opt, name), getattr(plain.opt, name))}
    assert same == set(KEPT_OPTIONS)
    for name in ("dof_damping", "dof_frictionloss", "dof_armature", "jnt_stiffness", "body_gravcomp"):
        assert not getattr(model, name).any(), name  # the vehicles' own drag is in `vehicle_forces.py`
