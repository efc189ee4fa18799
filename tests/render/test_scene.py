"""Bones move as their joints say, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.render.asset import Asset, Joint, Node
from autodrive.render.scene import Rig, rigid
from autodrive.transforms import quaternion_from_yaw

ROOT = rigid((3.0, -1.0, 0.5), quaternion_from_yaw(0.7))
AT = (0.2, 0.1, 0.05)


def moved(joint: Joint, signal: float, point: tuple[float, float, float]) -> np.ndarray:
    """Where a point of a node with that joint is, in the axes of the asset."""
    rig = Rig(Asset("thing", (Node("piece", position=AT, joint=joint),)))
    bone = rig.pose(ROOT, {joint.signal: signal})[rig.bone_of["piece"]]
    return (np.linalg.inv(ROOT) @ bone @ rig.place_of["piece"] @ (*point, 1.0))[:3]


def test_a_hinge_turns_about_its_axis_by_signal_times_gain() -> None:
    about_z = moved(Joint("hinge", "s", (0.0, 0.0, 1.0), gain=2.0), 0.3, (1.0, 0.0, 0.0))
    assert about_z == pytest.approx(np.add(AT, (math.cos(0.6), math.sin(0.6), 0.0)))
    about_y = moved(Joint("hinge", "s", (0.0, 1.0, 0.0)), 0.3, (0.0, 0.0, 1.0))  # a wheel that rolls forward
    assert about_y == pytest.approx(np.add(AT, (math.sin(0.3), 0.0, math.cos(0.3))))


def test_a_slide_moves_along_its_axis() -> None:
    assert moved(Joint("slide", "s", (0.0, 0.0, 1.0), gain=0.5), 0.02, (0.0, 0.0, 0.0)) == pytest.approx(
        np.add(AT, (0.0, 0.0, 0.01))
    )


def test_a_crank_goes_with_the_end_of_its_lever_and_does_not_turn() -> None:
    arm, angle = np.array([-0.022, 0.01]), 0.4
    turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ arm
    joint = Joint("crank", "s", arm=(-0.022, 0.01, 0.0))
    for point in ((0.0, 0.0, 0.0), (0.3, 0.2, 0.1)):
        assert moved(joint, angle, point) == pytest.approx(np.add(np.add(AT, point), (*(turned - arm), 0.0)))


def test_a_bone_carries_those_below_it_and_what_does_not_move_is_part_of_the_bone_above() -> None:
    nodes = (
        Node("steer", position=AT, joint=Joint("hinge", "steer")),
        Node("bracket", "steer", (0.0, 0.1, 0.0)),
        Node("wheel", "bracket", (0.0, 0.1, 0.0), joint=Joint("hinge", "spin", (0.0, 1.0, 0.0))),
    )
    rig = Rig(Asset("thing", nodes))
    assert rig.size == 3
    assert rig.bone_of["bracket"] == rig.bone_of["steer"]
    poses = rig.pose(np.eye(4), {"steer": math.pi / 2, "spin": 0.3})
    assert poses[rig.bone_of["wheel"]][:3, 3] == pytest.approx(np.add(AT, (-0.2, 0.0, 0.0)))
