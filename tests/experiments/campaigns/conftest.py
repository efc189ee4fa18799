"""Campaigns of short runs, and drivers that misbehave."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml

from autodrive.experiments.campaigns.campaign import Campaign

DRIVER = """
import os, sys, time
from autodrive import Command


class Driver:
    def __init__(self, throttle=0.5, fault=""):
        self.throttle, self.fault = throttle, fault

    def reset(self, scene):
        self.scene = scene

    def act(self, frame):
        print("what a driver prints is not a result")
        if frame.time > 0.2:
            if self.fault == "raises":
                raise ValueError("the road is lost")
            if self.fault == "leaves":
                sys.exit(3)
            if self.fault == "kills":
                os._exit(3)
            if self.fault == "hangs":
                time.sleep(1000)
            if self.fault == "talks":
                return {"V9": Command(1.0)}
        return Command(throttle=self.throttle, steering=0.1)


def top_speed(frames):
    return max(frame.vehicles["V1"].speed for frame in frames)
"""
SHORT: dict[str, Any] = {
    "scenario": "plane",
    "driver": "driver.py:Driver",
    "parameters": {
        "vehicles.V1.grip_factor": {"uniform": [0.3, 1.0]},
        "vehicles.V1.yaw_deg": {"uniform": [-90.0, 90.0]},
        "driver.throttle": [0.3, 0.6],
    },
    "samples": {"method": "sobol", "count": 8},
    "seeds": 2,
    "stop": {"time": 0.5},
    "metrics": ["distance", "collisions", "driver.py:top_speed"],
    "pass": "distance > 0.05 and collisions == 0",
}


@pytest.fixture(autouse=True)
def _own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The rows of other tests are not known, but compiled functions are where they were."""
    monkeypatch.setattr("autodrive.experiments.campaigns.keys.ROWS", tmp_path / "cache" / "rows.sqlite")


@pytest.fixture
def campaign(tmp_path: Path) -> Callable[..., Campaign]:
    """Makes a campaign of short runs with other values."""
    (tmp_path / "driver.py").write_text(DRIVER)

    def make(**changes: Any) -> Campaign:
        path = tmp_path / "short.yaml"
        path.write_text(yaml.safe_dump(SHORT | {key.rstrip("_"): value for key, value in changes.items()}))
        return Campaign.load(path)

    return make
