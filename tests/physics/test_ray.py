"""Ray intersections against MuJoCo's rays, with random shapes."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of MuJoCo have no types)

import math

import mujoco
import numpy as np
import pytest

from autodrive.base.arrays import Floats
from autodrive.physics.model import BOX, CYLINDER, SPHERE
from autodrive.physics.ray import MISS, cast_ray, inverse_distance

TYPES = {BOX: "box", CYLINDER: "cylinder", SPHERE: "sphere"}


def random_unit(rng: np.random.Generator, n: int) -> Floats:
    vector = rng.normal(size=n)
    return vector / np.linalg.norm(vector)


@pytest.mark.parametrize("kind", TYPES)
def test_distance_is_that_of_an_independent_engine(kind: int) -> None:
    rng = np.random.default_rng(kind)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><body mocap="true"><geom type="{TYPES[kind]}" size="1 1 1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    hits = 0
    for _ in range(300):
        size = rng.uniform(0.05, 0.5, 3)
        center = rng.uniform(-0.5, 0.5, 3)
        model.geom_size[0] = size
        data.mocap_pos[0], data.mocap_quat[0] = center, random_unit(rng, 4)
        mujoco.mj_kinematics(model, data)
        start = rng.uniform(-2, 2, 3)
        if np.linalg.norm(start - center) < 0.9:
            continue  # MuJoCo's rays also hit a shape from the inside
        direction = center + rng.normal(scale=0.3, size=3) - start
        direction /= np.linalg.norm(direction)
        expected = mujoco.mj_ray(model, data, start, direction, None, 1, -1, np.zeros(1, np.int32), np.zeros(3))
        rotation = data.geom_xmat[0]
        distance, *normal = cast_ray(kind, size, data.geom_xpos[0], rotation, *start, *direction)
        map_from_shape = rotation.reshape(3, 3)
        o, r = (start - center) @ map_from_shape, direction @ map_from_shape
        inverse = inverse_distance(kind, tuple(size), tuple(o), tuple(r))
        if expected < 0:
            assert (distance, inverse) == (MISS, 0.0)
            continue
        hits += 1
        assert distance == pytest.approx(expected, abs=1e-12)  # rounding
        assert 1.0 / inverse == pytest.approx(expected, abs=1e-12)
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        assert np.dot(normal, direction) < 0.0  # it points against the ray
    assert hits > 100


@pytest.mark.parametrize("kind", TYPES)
def test_a_ray_that_starts_inside_has_no_hit_for_a_wheel_and_range_zero_for_a_sensor(kind: int) -> None:
    distance, *_ = cast_ray(kind, np.full(3, 0.5), np.zeros(3), np.eye(3).ravel(), 0.1, 0.2, 0.1, 0.0, 0.0, -1.0)
    assert distance == MISS
    assert inverse_distance(kind, (0.5, 0.5, 0.5), (0.1, 0.2, 0.1), (0.0, 0.0, -1.0)) == math.inf


def test_the_normal_on_a_box_is_that_of_the_face_hit() -> None:
    box, turned = np.array([0.1, 0.2, 0.3]), np.array([0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # 90 degrees
    assert cast_ray(BOX, box, np.zeros(3), turned, 0.05, 0.0, 1.0, 0.0, 0.0, -1.0) == (0.7, 0.0, 0.0, 1.0)
    distance, *normal = cast_ray(BOX, box, np.zeros(3), turned, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0)
    assert distance == pytest.approx(0.8)
    assert normal == pytest.approx([1.0, 0.0, 0.0])
