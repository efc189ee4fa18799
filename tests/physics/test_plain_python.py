"""With compilation disabled the same source runs as plain Python, for example in a debugger."""

import json
import os
import subprocess
import sys

import pytest

import autodrive

DRIVE = """
import json
from tests.physics.test_plain_python import drive
print(json.dumps(drive()))
"""


def drive() -> list[float]:
    """Figures of a drive on the scenario `boxes`."""
    world = autodrive.make("boxes")
    for _ in range(30):
        world.step({"V1": autodrive.Command(throttle=0.8, steering=0.2)})
    car = world.frame.vehicles["V1"]
    assert car.lidar is not None
    return [*car.pose.position, *car.wheels.normal_load, *car.imu.euler, *car.lidar.ranges[:40]]


@pytest.mark.process
def test_plain_python_gives_the_results_of_compiled_code() -> None:
    plain = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", DRIVE],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(plain.stdout) == drive()
