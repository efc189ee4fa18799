"""Dead reckoning against the closed form of a circle."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.protocol.messages import EncoderReading, ImuReading
from autodrive.ros.odometer import Odometer


class Moment:
    """A vehicle whose rear axle has driven `way` [m] and turned by `yaw` [rad]."""

    def __init__(self, time: float, way: float, yaw: float, radius: float) -> None:
        nothing = np.zeros(3)
        turn = np.array([math.cos(0.5 * yaw), 0.0, 0.0, math.sin(0.5 * yaw)])
        self.encoders = EncoderReading(time, np.zeros(2, np.int64), np.array([0.9, 1.1]) * way / radius)
        self.imu = ImuReading(time, turn, nothing, nothing, nothing)


@pytest.mark.parametrize("start", [0.0, 3.0, -2.5])
def test_on_a_circle_it_knows_where_it_is(start: float) -> None:
    odometer, radius, circle, speed = Odometer(0.0325), 0.0325, 0.5, 0.4
    for n in range(1001):
        time = 0.01 * n
        odometer.take(Moment(time, speed * time, start + speed * time / circle, radius))  # type: ignore[arg-type]
    turned = 10.0 * speed / circle
    assert odometer.x == pytest.approx(circle * math.sin(turned), abs=1e-4)
    assert odometer.y == pytest.approx(circle * (1.0 - math.cos(turned)), abs=1e-4)
    assert odometer.yaw == pytest.approx(turned)
    assert odometer.speed == pytest.approx(speed)
    assert odometer.distance == pytest.approx(10.0 * speed)


def test_back_again_is_where_it_was_but_the_way_counts_twice() -> None:
    odometer = Odometer(0.0325)
    for time, way in ((0.0, 0.0), (1.0, 0.4), (2.0, 0.0)):
        odometer.take(Moment(time, way, 0.0, 0.0325))  # type: ignore[arg-type]
    assert odometer.x == pytest.approx(0.0)
    assert odometer.speed == pytest.approx(-0.4)
    assert odometer.distance == pytest.approx(0.8)
