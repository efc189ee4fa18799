"""The bridge's services after simulation_interfaces, called by the real rclpy: the simulator does what they say."""

from __future__ import annotations

import math
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from autodrive import Client
from tests.ros.ros2 import bridge, witness
from tests.ros.running import Witness, await_that, client, free_port, simulator

OK, UNSUPPORTED, NOT_FOUND, FAILED, ALREADY = 1, 0, 2, 4, 101
STOPPED, PLAYING, PAUSED, QUITTING, NO_WORLD = 0, 1, 2, 3, 4
PORT = free_port()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("services")


@pytest.fixture(scope="module")
def called(ros2: dict[str, str], folder: Path) -> Iterator[Witness]:
    """Calls the services, which are in a namespace."""
    with bridge(ros2, folder, "-r", "__ns:=/lab", port=PORT), witness(ros2, folder) as one:
        yield one


@pytest.fixture(scope="module")
def sim(called: Witness, folder: Path) -> Iterator[Client]:
    """Starts after the bridge, which waits for it."""
    assert (
        called.call("/lab/get_simulation_state", "simulation_interfaces/GetSimulationState")["state"]["state"]
        == NO_WORLD
    )
    run = simulator(folder, "boxes", "--no-cameras", port=PORT)
    with client(PORT) as one:
        await_that(lambda: ask(called, "get_simulation_state")["state"]["state"] == PLAYING)
        yield one
    run.end(signal.SIGTERM)


def ask(called: Witness, service: str, **values: Any) -> dict[str, Any]:
    kind = "".join(word.capitalize() for word in service.split("_"))
    return called.call(f"/lab/{service}", f"simulation_interfaces/{kind}", values)


def result(answer: dict[str, Any]) -> int:
    return answer["result"]["result"]


def test_its_features_are_those_that_it_has(called: Witness) -> None:
    features = ask(called, "get_simulator_features")["features"]
    assert set(features["features"]) == {10, 11, 20, 21, 22, 24, 25, 26, 31, 32, 40, 43, 44}
    assert {f"/lab/{name}" for name in ("step_simulation", "load_world")} <= set(called.services())


def test_steps_are_ticks_and_need_a_pause(called: Witness, sim: Client) -> None:
    assert result(ask(called, "step_simulation", steps=5)) == FAILED
    assert result(ask(called, "set_simulation_state", state={"state": PAUSED})) == OK
    before = sim.pause().tick
    assert ask(called, "get_simulation_state")["state"]["state"] == PAUSED
    assert result(ask(called, "step_simulation", steps=217)) == OK
    assert sim.frame.tick == before + 217
    assert result(ask(called, "set_simulation_state", state={"state": PAUSED})) == ALREADY
    assert result(ask(called, "set_simulation_state", state={"state": PLAYING})) == OK
    await_that(lambda: sim.frame.tick > before + 220)


def test_stopped_is_paused_at_the_beginning(called: Witness, sim: Client) -> None:
    assert result(ask(called, "set_simulation_state", state={"state": STOPPED})) == OK
    assert sim.status.is_paused
    assert sim.frame.tick == 0
    assert ask(called, "get_simulation_state")["state"]["state"] == STOPPED
    assert result(ask(called, "set_simulation_state", state={"state": QUITTING})) == UNSUPPORTED
    assert result(ask(called, "set_simulation_state", state={"state": PLAYING})) == OK


def test_a_pause_by_somebody_else_is_seen(called: Witness, sim: Client) -> None:
    sim.pause()
    await_that(lambda: ask(called, "get_simulation_state")["state"]["state"] == PAUSED)
    sim.resume()
    await_that(lambda: ask(called, "get_simulation_state")["state"]["state"] == PLAYING)


def test_a_reset_begins_anew(called: Witness, sim: Client) -> None:
    await_that(lambda: sim.frame.time > 0.5)
    sim.pause()
    assert result(ask(called, "reset_simulation")) == OK
    assert sim.frame.tick == 0
    assert result(ask(called, "reset_simulation", scope=4)) == UNSUPPORTED
    sim.resume()


def test_vehicles_and_objects_are_entities_and_stand_where_the_frame_says(called: Witness, sim: Client) -> None:
    names = ask(called, "get_entities")["entities"]
    frame = sim.pause()
    assert names == ["nigel_1", *frame.objects]
    assert ask(called, "get_entities", filters={"filter": "^nigel"})["entities"] == ["nigel_1"]
    assert result(ask(called, "get_entities", filters={"filter": "("})) == FAILED
    put = {"pose": {"position": {"x": 0.4, "y": -0.3}, "orientation": {"w": math.cos(0.5), "z": math.sin(0.5)}}}
    assert result(ask(called, "set_entity_state", entity="nigel_1", state=put)) == OK
    car = sim.step(ticks=1).vehicles["V1"]
    assert car.pose.position[:2] == pytest.approx([0.4, -0.3], abs=1e-3)
    assert 2.0 * math.atan2(car.pose.orientation[3], car.pose.orientation[0]) == pytest.approx(1.0, abs=1e-3)
    for name in ("nigel_1", names[1]):
        pose = car.pose if name == "nigel_1" else sim.frame.objects[name].pose

        def told(name: str = name) -> dict[str, Any]:
            return ask(called, "get_entity_state", entity=name)["state"]["pose"]

        await_that(lambda: [told()["position"][axis] for axis in "xyz"] == pytest.approx(pose.position, abs=1e-9))  # noqa: B023
        assert [told()["orientation"][axis] for axis in "wxyz"] == pytest.approx(pose.orientation)
    assert result(ask(called, "get_entity_state", entity="nobody")) == NOT_FOUND
    assert result(ask(called, "set_entity_state", entity=names[1], state=put)) == UNSUPPORTED
    sim.resume()


def test_worlds_are_scenarios(called: Witness, sim: Client) -> None:
    worlds = ask(called, "get_available_worlds")["worlds"]
    assert {one["world_resource"]["uri"]: one["description"] for one in worlds} == sim.scenarios
    assert ask(called, "get_current_world")["world"]["name"] == "boxes"
    assert result(ask(called, "load_world")) == 102  # no resource
    assert result(ask(called, "load_world", uri="atlantis")) == NOT_FOUND
    answer = ask(called, "load_world", uri="two_cars")
    assert (result(answer), answer["world"]["name"]) == (OK, "two_cars")
    assert sim.scene.scenario == "two_cars"
    assert (sim.frame.tick, sim.status.is_paused) == (0, True)
    assert ask(called, "get_simulation_state")["state"]["state"] == STOPPED
    await_that(lambda: ask(called, "get_entities")["entities"] == ["nigel_1", "nigel_2", *sim.frame.objects])
    called.listen("/lab/autodrive/nigel_2/odom", "nav_msgs/Odometry", "RELIABLE")
    sim.resume()
    assert called.latest("/lab/autodrive/nigel_2/odom")["message"]["child_frame_id"] == "nigel_2/base_link"
