"""Traffic lights against the closed form of their programs; stop lines against the path of the front of a car."""

import itertools
import math

import pytest

import autodrive
from autodrive.base.errors import CommandError, SpecError
from autodrive.protocol.messages import Command, Event, RedLight, StopSign, TrafficLightState
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.maps.light_programs import LightProgramSpec, light_cycles
from autodrive.scenario.maps.map import load_map
from autodrive.world import World

OFF, RED, YELLOW, GREEN = TrafficLightState
NAMES = [f"traffic_light_{number}" for number in range(1, 5)]
EAST_WEST, NORTH_SOUTH = NAMES[0], NAMES[1]
LINE = -0.67
"""x of the stop line of the first traffic light [m]."""
NOSE = 0.23
"""Of Nigel, ahead of the rear axle: its outline in the ROS package [m]."""
CYCLE = 22.0
"""Of Tiny Town: two phases of 8 s of green, 2 s of yellow and 1 s of red for all [s]."""


def expected(time: float, start: float) -> TrafficLightState:
    """What a light of Tiny Town shows whose green begins at `start` in the cycle."""
    place = (time - start) % CYCLE
    return GREEN if place < 8.0 else YELLOW if place < 10.0 else RED


def town(**fields: object) -> World:
    start = {"type": "nigel", "x": -1.1, "y": -0.15}
    return autodrive.make(ScenarioSpec.model_validate({"map": "tiny_town", "vehicles": {"V1": start}} | fields))


def driven(world: World, ticks: int, throttle: float = 1.0) -> list[Event]:
    frames = (world.step({"V1": Command(throttle, 0.0)}) for _ in range(ticks))
    return [event for frame in frames for event in frame.events if isinstance(event, RedLight | StopSign)]


# -- programs ----------------------------------------------------------------------------------------------------


def test_tiny_town_shows_what_its_program_says_for_two_cycles() -> None:
    world = town(tick=0.1, substep=0.005)
    frame = world.frame
    for tick in range(round(2.0 * CYCLE / 0.1)):
        time = (tick + 0.5) * 0.1  # between two ticks: rounding does not matter
        lights = frame.traffic_lights
        assert list(lights) == NAMES
        assert lights[EAST_WEST].state is lights[NAMES[2]].state is expected(time, 0.0)
        assert lights[NORTH_SOUTH].state is lights[NAMES[3]].state is expected(time, 11.0)
        assert {light.mode for light in lights.values()} == {"program"}
        frame = world.step()


def test_the_time_to_change_is_the_time_until_the_state_differs() -> None:
    program = LightProgramSpec.model_validate(
        {
            "groups": {"a": ["1"], "b": ["2"], "never": ["3"]},
            "phases": [
                {"green": ["a"], "duration": 1.3},
                {"green": ["a", "b"], "duration": 0.7},
                {"green": [], "duration": 0.4},
            ],
            "yellow": 0.2,
            "all_red": 0.1,
            "offset": 0.5,
        }
    )
    for light, cycle in light_cycles(program, 0.1).items():
        assert cycle.length == 27  # the third phase follows a yellow and an all-red
        shown = [cycle.at(tick)[0] for tick in range(-30, 100)]
        for i, tick in enumerate(range(-30, 30)):
            remaining = cycle.at(tick)[1]
            if light == "3":
                assert cycle.at(tick) == (RED, None)
            else:
                assert remaining == next(k for k in itertools.count(1) if shown[i + k] is not shown[i])
        if light == "1":
            assert [cycle.at(5 + k)[0] for k in (0, 19, 20, 21, 22, 26)] == [GREEN, GREEN, YELLOW, YELLOW, RED, RED]


def test_an_offset_shifts_a_program_in_time() -> None:
    fields = {
        "groups": {"a": ["1"], "b": ["2"]},
        "phases": [{"green": ["a"], "duration": 5}, {"green": ["b"], "duration": 7}],
    }
    first, later = (
        light_cycles(LightProgramSpec.model_validate(fields | {"offset": offset}), 0.01)["1"] for offset in (0.0, 3.21)
    )
    assert all(later.at(tick + 321) == first.at(tick) for tick in range(0, 3000, 7))
    assert later.at(0) != first.at(0)


def test_lights_flash_yellow_at_night_if_there_is_a_time_of_day() -> None:
    world = town(time_of_day="23:30")
    states = [world.step().traffic_lights[EAST_WEST] for _ in range(200)]
    assert {light.mode for light in states} == {"flashing"}
    assert [light.state for light in states] == [YELLOW if (tick // 50) % 2 == 0 else OFF for tick in range(1, 201)]
    assert states[0].time_to_change == pytest.approx(0.49)
    world.set_time_of_day(3600.0 * 12)
    assert world.frame.traffic_lights[EAST_WEST].mode == "program"


def test_a_request_overrides_a_program_until_it_is_withdrawn_or_the_world_is_reset() -> None:
    world = town()
    world.set_traffic_light(EAST_WEST, RED)
    assert world.frame.traffic_lights[EAST_WEST].state is RED
    assert world.frame.traffic_lights[EAST_WEST].mode == "set"
    saved = world.save()
    world.set_traffic_light(EAST_WEST, None)
    assert world.frame.traffic_lights[EAST_WEST].state is GREEN
    world.restore(saved)
    assert world.frame.traffic_lights[EAST_WEST].state is RED
    assert world.reset().traffic_lights[EAST_WEST].state is GREEN
    with pytest.raises(CommandError, match="Known: traffic_light_1, "):
        world.set_traffic_light("traffic_light_l", RED)
    with pytest.raises(CommandError, match="must be None or one of 0 off, 1 red, 2 yellow, 3 green, not 4"):
        world.set_traffic_light(EAST_WEST, 4)  # type: ignore[arg-type]


def test_a_scenario_changes_and_removes_programs_of_its_map() -> None:
    assert {light.mode for light in town(light_programs={"intersection": None}).frame.traffic_lights.values()} == {
        "off"
    }
    program = {"groups": {"all": [NAMES[0]]}, "phases": [{"green": ["all"], "duration": 1}]}
    lights = town(light_programs={"intersection": program}).frame.traffic_lights
    assert [(light.state, light.mode) for light in lights.values()] == [(GREEN, "program"), *[(OFF, "off")] * 3]
    with pytest.raises(SpecError, match=r"light_programs.other: light 'traffic_light_1' is also in the program"):
        town(light_programs={"other": program})
    program = {"groups": {"all": ["traffic_light_9"]}, "phases": [{"green": ["all"], "duration": 1}]}
    with pytest.raises(SpecError, match="the map has no traffic light 'traffic_light_9'"):
        town(light_programs={"other": program})


def test_a_map_without_traffic_lights_has_none_in_its_frames() -> None:
    assert autodrive.make("mini_map").step().traffic_lights == {}


# -- stop lines --------------------------------------------------------------------------------------------------


def test_stop_lines_belong_to_the_lights_and_the_sign_of_tiny_town() -> None:
    lines = {line.prop: line for line in load_map("tiny_town").stop_lines}
    assert set(lines) == {*NAMES, "stop_16"}
    assert lines[EAST_WEST].pose == pytest.approx((LINE, -0.15, 0.0))
    assert lines[EAST_WEST].width == 0.3


@pytest.mark.parametrize("state", [RED, YELLOW, GREEN, OFF])
def test_a_car_that_crosses_the_line_at_red_makes_one_event_at_that_tick(state: TrafficLightState) -> None:
    world = town()
    world.set_traffic_light(EAST_WEST, state)
    found: list[RedLight] = []
    crossed = math.nan
    for _ in range(300):
        frame = world.step({"V1": Command(1.0, 0.0)})
        if math.isnan(crossed) and frame.vehicles["V1"].pose.position[0] + NOSE >= LINE:
            crossed = frame.time
        found += [event for event in frame.events if isinstance(event, RedLight)]
    assert crossed > 0.1
    if state is RED:
        (event,) = found
        assert (event.vehicle, event.light) == ("V1", EAST_WEST)
        assert event.time == pytest.approx(crossed, abs=0.001)
        assert event.position[0] + NOSE == pytest.approx(LINE, abs=0.01)
    else:
        assert found == []


def test_a_car_that_is_put_behind_the_line_has_not_crossed_it() -> None:
    world = town()
    world.set_traffic_light(EAST_WEST, RED)
    world.step()
    world.teleport("V1", 0.0, -0.15, 0.0)
    assert driven(world, 5) == []


@pytest.mark.parametrize(("stops_at", "is_event"), [(None, True), (0.1, False), (0.8, True)])
def test_a_car_must_stop_within_its_length_before_the_line_of_a_stop_sign(
    stops_at: float | None, is_event: bool
) -> None:
    """Out of the parking lot of Tiny Town; the stop is made with the front so far before the line [m]."""
    (line,) = (line for line in load_map("tiny_town").stop_lines if line.kind == "stop")
    x, y, yaw = line.pose

    def at(before: float) -> tuple[float, float, float]:
        return x - (before + NOSE) * math.cos(yaw), y - (before + NOSE) * math.sin(yaw), yaw

    start = VehiclePlacement(type="nigel", x=at(0.6)[0], y=at(0.6)[1], yaw_deg=math.degrees(yaw))
    world = autodrive.make(ScenarioSpec(map="tiny_town", vehicles={"V1": start}))
    if stops_at is None:  # it comes without a stop: at the start it stands, out of reach
        assert [type(event) for event in driven(world, 250)] == [StopSign]
        return
    if stops_at < 0.6:
        world.teleport("V1", *at(stops_at))
        assert driven(world, 20, 0.0) == []
    assert [type(event) for event in driven(world, 250)] == [StopSign] * is_event


def test_lights_show_what_they_showed_at_that_tick_after_jumps_in_time() -> None:
    world = town(tick=0.1, substep=0.005)
    saved = [(world.save(), world.frame.traffic_lights)]
    for _ in range(3):
        driven(world, 90)
        saved.append((world.save(), world.frame.traffic_lights))
    world.set_time_of_day(0.0)  # they flash
    saved.append((world.save(), world.frame.traffic_lights))
    for place in (1, 4, 1, 0, 3, 4, 2, 4, 0):
        state, lights = saved[place]
        world.restore(state)
        assert world.frame.traffic_lights == lights
    assert [lights[EAST_WEST].mode for _, lights in saved] == ["program"] * 4 + ["flashing"]
    world.restore(saved[4][0])
    assert world.reset().traffic_lights == saved[0][1]


# -- the crossing ------------------------------------------------------------------------------------------------


def test_each_light_of_the_crossing_stands_for_the_line_of_the_arm_that_sees_it() -> None:
    world = autodrive.make("crossing", seed=1)
    drive = dict.fromkeys(world.frame.vehicles, Command(1.0, 0.0))
    events = [event for _ in range(400) for event in world.step(drive).events if isinstance(event, RedLight)]
    # green begins for the cars on the x axis, which cross their lines meanwhile
    assert {(event.vehicle, event.light) for event in events} == {("V2", "traffic_light_2"), ("V4", "traffic_light_4")}
    # the others have crossed, too
    assert all(abs(vehicle.pose.position[:2]).max() < 0.97 + NOSE for vehicle in world.frame.vehicles.values())
