"""The command `weather`, and the option `--weather` of `run`."""

from __future__ import annotations

import math
import re

import pytest

from autodrive.base.errors import SpecError
from autodrive.cli.weather import environment
from autodrive.physics.weather import SURFACES
from autodrive.run.options import RunOptions
from autodrive.run.world_loader import WorldLoader
from tests.support.command_line import call


def test_a_weather_is_printed_in_numbers() -> None:
    dry, wet = (call("weather", *values).stdout for values in (["sunny"], ["rain=0.6", "time=18:30"]))
    grips = [float(grip) for grip in re.findall(r"grip ([\d.]+)", wet)]
    assert grips == [round(SURFACES["asphalt"].wet_grip, 2)] * 2
    assert re.findall(r"grip ([\d.]+)", dry) == ["1.00", "1.00"]
    distances = [[float(d) for d in re.findall(r"in ([\d.]+) m", text)] for text in (dry, wet)]
    (nigel, racer), (wet_nigel, wet_racer) = distances
    assert wet_nigel > 1.3 * nigel
    drag, speed = 0.273, 8.0  # locked wheels and linear drag: v / c - a / c^2 log(1 + c v / a) for dv/dt = -a - c v
    for distance, grip in ((racer, 1.0), (wet_racer, SURFACES["asphalt"].wet_grip)):
        sliding = 0.464 * 9.81 * grip
        way = speed / drag - sliding / drag**2 * math.log(1.0 + drag * speed / sliding)
        assert distance == pytest.approx(way, rel=0.02)
    # 0.1 becomes 0.0543 (Lekner and Dorf); in the air, rain of 18 mm/h takes 1.076 * 18^0.67 dB/km
    assert "LIDAR 8.7 m at 10 %" in wet
    assert "night" in wet
    assert "light" not in dry


def test_values_of_the_option_replace_those_of_the_scenario() -> None:
    loader = WorldLoader(RunOptions("mini_map", cameras=False, environment=environment(["heavy_rain,fog=0.2"])))
    world = loader.load("mini_map")
    assert world.weather is not None
    assert (world.weather.rain, world.weather.fog) == (0.8, 0.2)
    assert world.time_of_day is None
    for wrong, text in ((["rain=2"], "rain"), (["rian=1"], "did you mean 'rain'"), (["foggy"], "light_fog")):
        with pytest.raises(SpecError, match=f"(?i){text}"):
            environment(wrong)
