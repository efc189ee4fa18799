"""Rays for wheels against MuJoCo's own, in heaps of random shapes."""

import mujoco
import numpy as np
import pytest

from autodrive.model import BOX, CYLINDER, SPHERE
from autodrive.physics.ray import MISS, ray_shape

NAMES = {BOX: "box", CYLINDER: "cylinder", SPHERE: "sphere"}


@pytest.mark.parametrize("kind", NAMES)
def test_distance_is_that_of_an_independent_engine(kind: int) -> None:
    rng = np.random.default_rng(kind)
    hits = 0
    for _ in range(300):
        size = rng.uniform(0.05, 0.5, 3)
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        centre = rng.uniform(-0.5, 0.5, 3)
        text = " ".join(map(repr, map(float, size[: {BOX: 3, CYLINDER: 2, SPHERE: 1}[kind]])))
        model = mujoco.MjModel.from_xml_string(
            f'<mujoco><worldbody><geom type="{NAMES[kind]}" size="{text}" pos="{" ".join(map(str, centre))}" '
            f'quat="{" ".join(map(str, quaternion))}"/></worldbody></mujoco>'
        )
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        start = rng.uniform(-2, 2, 3)
        if np.linalg.norm(start - centre) < 0.9:
            continue  # the engine also sees a shape from inside
        direction = centre + rng.normal(scale=0.3, size=3) - start
        direction /= np.linalg.norm(direction)
        theirs = mujoco.mj_ray(model, data, start, direction, None, 1, -1, np.zeros(1, np.int32), np.zeros(3))
        distance, *normal = ray_shape(kind, size, data.geom_xpos[0], data.geom_xmat[0], *start, *direction)
        if theirs < 0:
            assert distance == MISS
            continue
        hits += 1
        assert distance == pytest.approx(theirs, abs=1e-12)  # rounding
        assert np.linalg.norm(normal) == pytest.approx(1.0, abs=1e-12)
        assert np.dot(normal, direction) < 0.0  # it faces the ray
    assert hits > 100


@pytest.mark.parametrize("kind", NAMES)
def test_ray_from_inside_a_shape_misses_it(kind: int) -> None:
    distance, *_ = ray_shape(kind, np.full(3, 0.5), np.zeros(3), np.eye(3).ravel(), 0.1, 0.2, 0.1, 0.0, 0.0, -1.0)
    assert distance == MISS


def test_normal_of_a_box_is_that_of_the_face_that_was_hit() -> None:
    box, turned = np.array([0.1, 0.2, 0.3]), np.array([0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # 90 degrees
    assert ray_shape(BOX, box, np.zeros(3), turned, 0.05, 0.0, 1.0, 0.0, 0.0, -1.0) == (0.7, 0.0, 0.0, 1.0)
    distance, *normal = ray_shape(BOX, box, np.zeros(3), turned, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0)
    assert distance == pytest.approx(0.8)
    assert normal == pytest.approx([1.0, 0.0, 0.0])
