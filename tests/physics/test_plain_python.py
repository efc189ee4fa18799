"""With compilation switched off the same source runs as plain Python, for students to step through."""

import json
import os
import subprocess
import sys

import pytest

DRIVE = """
import json, autodrive
world = autodrive.make("boxes")
for _ in range(40):
    frame = world.step({"V1": autodrive.Command(throttle=0.8, steering=0.2)})
car = frame.vehicles["V1"]
print(json.dumps([*car.pose.position, *car.wheels.normal_load, *car.imu.euler, *car.lidar.ranges[:40]]))
"""


def driven(**environment: str) -> list[float]:
    run = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", DRIVE],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(run.stdout)


def test_plain_python_drives_as_the_compiled_code_does() -> None:
    assert driven(NUMBA_DISABLE_JIT="1") == pytest.approx(driven(), abs=1e-9)  # libraries of sin and atan may differ
