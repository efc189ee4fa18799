"""A sensor of a user with noise and a state, and a scenario file that names it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from autodrive.world import SensorView


class Radar:
    """Distance straight ahead with noise, speed, and the number of the sample."""

    rate = 20.0
    columns = ("distance [m]", "speed [m/s]", "sample")

    def __init__(self) -> None:
        self.samples = np.zeros(1)

    def sample(self, view: SensorView, random: np.random.Generator) -> Any:
        self.samples += 1.0
        (distance,) = view.cast((0.3, 0.0, 0.1), (1.0, 0.0, 0.0))
        return distance + random.normal(0.0, 0.01), view.velocity[0], self.samples[0]


def radar_scenario(folder: Path, map_: str = "mini_map") -> Path:
    """A scenario file whose vehicle V1 has the sensor 'radar', in a file beside it."""
    (folder / "my_radar.py").write_text(Path(__file__).read_text(encoding="utf-8"), encoding="utf-8")
    path = folder / "radar.yaml"
    text = f"map: {map_}\nvehicles:\n  V1:\n    own_sensors: {{radar: my_radar.py:Radar}}\n"
    path.write_text(text, encoding="utf-8")
    return path
