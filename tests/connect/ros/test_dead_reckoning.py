"""Dead reckoning compared with the closed form of a circle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.connect.ros.dead_reckoning import DeadReckoning
from autodrive.protocol.messages import EncoderReading, ImuReading


class Readings:
    """Encoders and IMU of a vehicle whose rear axle has driven `distance` [m] and turned by `yaw` [rad]."""

    def __init__(self, time: float, distance: float, yaw: float, radius: float) -> None:
        nothing = np.zeros(3)
        turn = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
        self.encoders = EncoderReading(time, np.zeros(2, np.int64), np.array([0.9, 1.1]) * distance / radius)
        self.imu = ImuReading(time, turn, nothing, nothing, nothing)


@pytest.mark.parametrize("start", [0.0, 3.0, -2.5])
def test_the_pose_on_a_circle_is_exact(start: float) -> None:
    reckoning, radius, circle, speed = DeadReckoning(0.0325), 0.0325, 0.5, 0.4
    for n in range(1001):
        time = 0.01 * n
        reckoning.update(Readings(time, speed * time, start + speed * time / circle, radius))  # type: ignore[arg-type]
    turned = 10.0 * speed / circle
    assert reckoning.x == pytest.approx(circle * math.sin(turned), abs=1e-4)
    assert reckoning.y == pytest.approx(circle * (1.0 - math.cos(turned)), abs=1e-4)
    assert reckoning.yaw == pytest.approx(turned)
    assert (reckoning.speed, reckoning.interval) == pytest.approx((speed, 0.01))
    assert reckoning.distance == pytest.approx(10.0 * speed)


def test_the_way_back_returns_to_the_start_and_adds_to_the_distance() -> None:
    reckoning = DeadReckoning(0.0325)
    for time, way in ((0.0, 0.0), (1.0, 0.4), (2.0, 0.0)):
        reckoning.update(Readings(time, way, 0.0, 0.0325))  # type: ignore[arg-type]
    assert reckoning.x == pytest.approx(0.0)
    assert reckoning.speed == pytest.approx(-0.4)
    assert reckoning.distance == pytest.approx(0.8)
