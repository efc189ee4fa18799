"""Markers of a program of ROS, as a viewer of the simulator gets them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from autodrive import Client
from autodrive.base.transforms import rotate
from tests.support.viewer import Viewer

KIND = "visualization_msgs/MarkerArray"


def check_markers(publish: Callable[[str, Any], None], sim: Client, port: int, lifetime: dict[str, int]) -> None:
    """`publish(kind, fields)`; `lifetime`: 2.5 s. The car stands."""
    points = [{"x": 0.0, "y": 0.0, "z": 0.125}, {"x": 1.0, "y": 0.5, "z": 0.125}]
    line = {"header": {"frame_id": "map"}, "ns": "plan", "id": 7, "type": 4, "scale": {"x": 0.25}}
    line |= {"color": {"r": 1.0, "g": 0.5, "b": 0.0, "a": 1.0}, "points": points, "lifetime": lifetime}
    ahead = {"position": {"x": 0.5}, "orientation": {"w": 1.0}}
    ball = {"header": {"frame_id": "base_link"}, "ns": "goal", "type": 2, "pose": ahead, "scale": {"x": 0.125}}
    ball["color"] = {"a": 1.0}
    viewer = Viewer(f"127.0.0.1:{port}")
    publish(KIND, {"markers": [line, ball]})
    drawn = viewer.wait_for("plan/7", "goal/0")
    plan, goal = drawn["plan/7"].drawing, drawn["goal/0"].drawing
    assert plan is not None
    assert goal is not None
    assert (plan.kind, plan.size, plan.lifetime, plan.color) == ("path", 0.25, 2.5, (1.0, 0.5, 0.0, 1.0))
    assert [list(one) for one in plan.points] == [[0.0, 0.0, 0.125], [1.0, 0.5, 0.125]]
    assert (goal.kind, goal.size) == ("points", 0.125)
    pose = sim.wait().vehicles["V1"].pose
    assert goal.points[0] == pytest.approx(pose.position + rotate(pose.orientation, (0.5, 0.0, 0.0)), abs=1e-3)
    publish(KIND, {"markers": [{"action": 3}]})
    viewer.wait_for()
    publish(KIND, None)
