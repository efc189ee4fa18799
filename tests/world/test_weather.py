"""The weather of a World: set, followed, saved, recorded, and in batches with the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command, CommandError, Scenario, Weather, World
from autodrive.base.errors import SpecError
from autodrive.base.specs import checked
from autodrive.protocol.messages import Frame, SetWeather, Step
from autodrive.protocol.weather import PRESETS
from autodrive.world.simulation import Simulation

FORWARD = {"V1": Command(throttle=0.5, steering=0.1)}
STORM = Weather(clouds=1.0, fog=0.3, rain=0.8, snow=0.2, wind=0.5)


def scenario(**values: Any) -> Scenario:
    """A scenario, with the short forms of a file."""
    return Scenario.model_validate(values)


def bits(frame: Frame) -> bytes:
    vehicle = frame.vehicles["V1"]
    assert vehicle.lidar is not None
    return vehicle.pose.position.tobytes() + vehicle.velocity.tobytes() + vehicle.lidar.ranges.tobytes()


def drive(world: World, ticks: int = 60) -> list[bytes]:
    return [bits(world.step(FORWARD)) for _ in range(ticks)]


def test_clear_weather_has_the_bits_of_none() -> None:
    clear, none = autodrive.make(scenario(weather={"clouds": 0.0})), autodrive.make()
    assert clear.frame.weather is clear.weather is None
    cloudy = autodrive.make(scenario(map="mini_map", weather={"clouds": 1.0, "wind": 1.0}))
    plain = autodrive.make(scenario(map="mini_map"))
    assert drive(cloudy) == drive(plain)  # neither tyres nor LIDAR see clouds
    none.set_weather(STORM)
    none.set_weather()
    none.reset()
    assert drive(none) == drive(autodrive.make())


def test_a_scenario_starts_with_its_weather_and_time_of_day() -> None:
    world = autodrive.make(scenario(map="mini_map", weather="heavy_rain", time_of_day="18:30"))
    assert world.frame.time_of_day == 18.5 * 3600.0
    assert not world.frame.scene_light
    assert world.frame.weather == Weather(clouds=1.0, rain=0.8, wetness=1.0, snow_cover=0.0)
    world.set_weather()
    for _ in range(11):
        world.step()
    frame = world.frame
    assert frame.weather is not None
    assert frame.weather.rain == 0.0
    assert frame.weather.wetness == pytest.approx(math.exp(-0.1 / 300.0))  # it dries
    assert world.reset().weather == Weather(clouds=1.0, rain=0.8, wetness=1.0, snow_cover=0.0)


def test_a_held_ground_stays_held_when_other_amounts_change() -> None:
    with Simulation(autodrive.make(), is_paused=True) as simulation:
        world = simulation.world

        def given(weather: Weather, **more: bool) -> Weather | None:
            simulation.request(SetWeather(weather, **more)).result()
            simulation.request(Step(20)).result()
            return world.weather

        assert given(Weather(wetness=0.5)) == Weather(wetness=0.5, snow_cover=0.0)
        assert given(Weather(wind=0.3), keeps_ground=True) == Weather(wind=0.3, wetness=0.5, snow_cover=0.0)
        assert given(Weather(wetness=0.7), keeps_ground=True) == Weather(wetness=0.7, snow_cover=0.0)
        dried = given(Weather())
        assert dried is not None
        assert dried.wetness is not None
        assert dried.wetness < 0.7


@pytest.mark.parametrize("time", ["18:30", "18:30:00", 66600, "66600", "66600.0"])
def test_a_time_of_day_is_seconds_or_hours_and_minutes(time: str | float) -> None:
    assert scenario(time_of_day=time).time_of_day == 66600.0


def test_wrong_weather_is_refused() -> None:
    for wrong, text in (
        ({"weather": "hevy_rain"}, "heavy_rain"),
        *(({"time_of_day": text}, "18:30") for text in ("half past six", "24:00", "18:60", "18:30:75", "18.3.0", "-5")),
        ({"time_of_day": "86400"}, "86400"),
        ({"weather": {"rain": 1.5}}, r"weather\.rain"),
    ):
        with pytest.raises(SpecError, match=text):
            checked(wrong, Scenario)
    world = autodrive.make()
    for wrong in (Weather(rain=1.5), Weather(fog=math.nan), Weather(wetness=-0.1), "rain"):
        with pytest.raises(CommandError, match="weather"):
            world.set_weather(wrong)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
    assert world.weather is None


def test_same_weather_and_seed_have_the_same_bits() -> None:
    world, same, other = (autodrive.make(scenario(map="mini_map", weather={"fog": 0.8}), seed) for seed in (1, 1, 2))
    reference = drive(world)
    assert drive(same) == reference
    assert drive(other) != reference
    world.reset()
    assert drive(world) == reference


def test_the_lidar_of_a_world_that_continues_another_one_sees_its_weather() -> None:
    amounts = {"clouds": 1.0, "fog": 1.0, "rain": 0.8, "snow": 0.2, "wind": 0.5}
    storm = scenario(map="mini_map", weather=amounts, vehicles={"V1": {"has_realistic_sensors": True}})
    before, same, other = autodrive.make(storm), autodrive.make(storm), autodrive.make(storm)
    drive(before)
    drive(same)
    other.continue_from(before)

    def scans(world: World) -> list[bytes]:
        return [world.step().vehicles["V1"].lidar.ranges.tobytes() for _ in range(60)]  # type: ignore[union-attr]

    assert scans(other) == scans(same)


def lidar_ranges(map_: str, weather: Weather, ticks: int = 100) -> np.ndarray:
    """All scans of a car that stands still."""
    world = autodrive.make(scenario(map=map_))
    world.set_weather(weather)
    scans = {}
    for _ in range(ticks):
        scan = world.step().vehicles["V1"].lidar
        assert scan is not None
        if scan.time > 0.0:  # the first one was before the weather
            scans[scan.time] = scan.ranges
    return np.array([*scans.values()])


def test_fog_hides_far_walls_and_returns_from_the_air() -> None:
    clear, foggy = lidar_ranges("mini_map", Weather()), lidar_ranges("mini_map", Weather(fog=1.0))
    near = clear < 0.8
    assert near.any()
    assert (foggy[near] == clear[near]).all()  # within the overlap the air returns nothing
    far = (clear > 4.0) & np.isfinite(clear)
    assert far.any()
    changed = foggy[far] != clear[far]
    assert changed.mean() > 0.95
    false = foggy[far][changed & np.isfinite(foggy[far])]
    # exponential beyond 1 m, with the mean 1 / (2 a + 2 / R2), a = ln 20 / 5 m
    assert false.mean() == pytest.approx(1.0 + 1.0 / (2.0 * math.log(20.0) / 5.0 + 2.0), rel=0.1)
    assert false.min() > 1.0


def test_ips_imu_and_encoders_do_not_see_the_weather() -> None:
    clear, storm = autodrive.make(), autodrive.make()
    storm.set_weather(Weather(fog=1.0, clouds=1.0, wind=1.0))  # no water: the same grip
    for _ in range(30):
        dry, other = clear.step(FORWARD).vehicles["V1"], storm.step(FORWARD).vehicles["V1"]
        assert dry.ips.position.tobytes() == other.ips.position.tobytes()
        assert dry.imu.linear_acceleration.tobytes() == other.imu.linear_acceleration.tobytes()
        assert dry.encoders.ticks.tobytes() == other.encoders.ticks.tobytes()


@pytest.mark.parametrize("name", PRESETS)
def test_each_preset_can_be_the_weather_of_a_scenario(name: str) -> None:
    spec = scenario(weather=name)
    assert spec.weather.message == PRESETS[name]
