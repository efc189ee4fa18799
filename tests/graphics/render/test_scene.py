"""Joints move their bones: compared with closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.base.transforms import quaternion_from_yaw
from autodrive.graphics.assets.asset import Asset, AssetNode, NodeJoint
from autodrive.graphics.render.scene import Skeleton, rigid

ROOT = rigid((3.0, -1.0, 0.5), quaternion_from_yaw(0.7))
AT = (0.2, 0.1, 0.05)


def moved(joint: NodeJoint, signal: float, point: tuple[float, float, float]) -> np.ndarray:
    """Position of a point of a node with that joint, in the axes of the asset."""
    skeleton = Skeleton(Asset("thing", (AssetNode("piece", position=AT, joint=joint),)))
    bone = skeleton.pose(ROOT, {joint.signal: signal})[skeleton.bone_of["piece"]]
    return (np.linalg.inv(ROOT) @ bone @ skeleton.place_of["piece"] @ (*point, 1.0))[:3]


def test_a_hinge_turns_about_its_axis_by_signal_times_gain() -> None:
    about_z = moved(NodeJoint("hinge", "s", (0.0, 0.0, 1.0), gain=2.0), 0.3, (1.0, 0.0, 0.0))
    assert about_z == pytest.approx(np.add(AT, (math.cos(0.6), math.sin(0.6), 0.0)))
    about_y = moved(NodeJoint("hinge", "s", (0.0, 1.0, 0.0)), 0.3, (0.0, 0.0, 1.0))  # a wheel that rolls forward
    assert about_y == pytest.approx(np.add(AT, (math.sin(0.3), 0.0, math.cos(0.3))))


def test_a_slide_moves_along_its_axis() -> None:
    assert moved(NodeJoint("slide", "s", (0.0, 0.0, 1.0), gain=0.5), 0.02, (0.0, 0.0, 0.0)) == pytest.approx(
        np.add(AT, (0.0, 0.0, 0.01))
    )


def test_a_crank_moves_with_the_end_of_its_lever_and_does_not_turn() -> None:
    arm, angle = np.array([-0.022, 0.01]), 0.4
    turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ arm
    joint = NodeJoint("crank", "s", arm=(-0.022, 0.01, 0.0))
    for point in ((0.0, 0.0, 0.0), (0.3, 0.2, 0.1)):
        assert moved(joint, angle, point) == pytest.approx(np.add(np.add(AT, point), (*(turned - arm), 0.0)))


def test_a_bone_moves_its_children_and_nodes_without_joint_belong_to_the_bone_of_their_parent() -> None:
    nodes = (
        AssetNode("steer", position=AT, joint=NodeJoint("hinge", "steer")),
        AssetNode("bracket", "steer", (0.0, 0.1, 0.0)),
        AssetNode("wheel", "bracket", (0.0, 0.1, 0.0), joint=NodeJoint("hinge", "spin", (0.0, 1.0, 0.0))),
    )
    skeleton = Skeleton(Asset("thing", nodes))
    assert skeleton.size == 3
    assert skeleton.bone_of["bracket"] == skeleton.bone_of["steer"]
    poses = skeleton.pose(np.eye(4), {"steer": math.pi / 2, "spin": 0.3})
    assert poses[skeleton.bone_of["wheel"]][:3, 3] == pytest.approx(np.add(AT, (-0.2, 0.0, 0.0)))
