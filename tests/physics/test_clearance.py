"""How far a vehicle can move before it can touch something: never farther than MuJoCo's distance of the shapes."""

# pyright: reportAttributeAccessIssue=false
# (mujoco has no type information)

import math

import mujoco
import numpy as np
import pytest

import autodrive
from autodrive.base.arrays import Floats
from autodrive.base.transforms import rotation_from_quaternion
from autodrive.physics.buffers import scratch
from autodrive.physics.clearance import HORIZON, MARGIN, can_any_touch, find_nearby
from autodrive.physics.engine import Geom
from autodrive.physics.model import BOX, COVER
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import names
from autodrive.scenario.tracks import Track
from autodrive.scenario.vehicles.parameters import cover
from tests.physics.test_contact_engine import TRACK, YARD, engine_is_at, random_start
from tests.support.whole_map import whole_map_world

CASES = 40


def surface(geom: Geom, rng: np.random.Generator) -> Floats:
    """Points of a collider in the vehicle frame, its corners or both rims among them, shape (n, 3)."""
    points = rng.uniform(-1.0, 1.0, (200, 3))
    if geom.kind == BOX:
        points[:100] = np.sign(points[:100])
        points *= geom.size
    else:
        points[:100] /= np.hypot(points[:100, 0], points[:100, 1])[:, None]
        points[:100, 2] = np.sign(points[:100, 2])
        points[100:, :2] *= math.sqrt(0.5)
        points *= geom.size[[0, 0, 1]]
    return points @ np.array(rotation_from_quaternion(geom.orientation)).reshape(3, 3).T + geom.position


@pytest.mark.parametrize("car", names("vehicle"))
def test_the_small_spheres_cover_all_colliders(car: str) -> None:
    c = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=car)})).compiled
    (row,) = c.model.vehicles
    colliders = [geom for geom in c.engine.geoms() if geom.body == row["body"]]
    assert len(colliders) > 5
    rng = np.random.default_rng(1)
    points = np.concatenate([surface(geom, rng) for geom in colliders])
    for spheres in (row["cover"], np.array([[*row["sphere_centre"], row["sphere_radius"]]])):
        outside = np.linalg.norm(points[:, None] - spheres[:, :3], axis=2) - spheres[:, 3]
        assert outside.min(axis=1).max() < 1e-12  # rounding
    assert row["cover"][:, 3].max() < row["sphere_radius"]


def test_a_slice_without_a_collider_has_the_sphere_of_the_slice_behind_it() -> None:
    boxes = np.array([[[0.0, 0.0, 0.0], [0.1, 0.1, 0.1]], [[0.9, 0.0, 0.0], [1.0, 0.1, 0.1]]])
    spheres = np.array(cover(boxes))
    assert spheres.shape == (COVER, 4)
    assert (spheres[1] == spheres[0]).all()
    assert spheres[2, :3] == pytest.approx([0.95, 0.05, 0.05])


@pytest.mark.parametrize("scenario", [YARD, TRACK], ids=["yard", "track"])
def test_a_clearance_is_never_above_the_distance_that_mujoco_finds(scenario: ScenarioSpec) -> None:
    world = whole_map_world(scenario)
    world.step()
    c, settled = world.compiled, world.save()
    memory = scratch(c.model, c.engine.body_count)
    model, data = c.engine.model, c.engine.data
    moving = {int(row["body"]): i for i, row in enumerate(c.model.vehicles)}
    geoms = c.engine.geoms()
    others = [(geom, 0) for geom in range(1, 1 + c.model.shapes.n_fixed)] + [(geom.number, geom.body) for geom in geoms]
    small = 0
    for seed in range(CASES):
        world.restore(settled)
        random_start(world, np.random.default_rng(seed))
        for i in range(len(moving)):
            find_nearby(i, c.model, c.state, memory, 0.0)
        can_any_touch(c.model, c.state, memory)
        data.qpos[:] = c.state.qpos
        mujoco.mj_kinematics(model, data)
        for own in geoms:
            if (i := moving.get(own.body)) is None:
                continue
            clearance = memory.clearance[i]
            assert clearance <= HORIZON
            small += MARGIN < clearance < 0.1
            for other, body in others:
                if body == own.body:
                    continue
                share = 2.0 if body in moving else 1.0  # both may move
                distance = mujoco.mj_geomDistance(model, data, own.number, other, 0.6, None)
                assert share * clearance <= max(distance, 0.0) + 1e-6 or clearance <= 0.0, (seed, i, other)
    assert small > CASES


def test_cars_side_by_side_between_the_walls_of_a_track_need_no_engine() -> None:
    track = Track.load("practice")
    poses = {f"V{i}": track.pose_at(5.0, lateral) for i, lateral in enumerate((-0.38, 0.0, 0.38))}
    vehicles = {
        name: VehiclePlacement(type="roboracer", x=x, y=y, yaw_deg=math.degrees(yaw))
        for name, (x, y, yaw) in poses.items()
    }
    world = autodrive.make(ScenarioSpec(map="practice", vehicles=vehicles))
    for _ in range(20):
        world.step()
        assert not engine_is_at(world)
