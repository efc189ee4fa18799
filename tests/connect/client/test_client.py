"""The client against a real simulator in this process; the expected values are those of the World."""

from __future__ import annotations

import itertools
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

import autodrive
from autodrive import Client, Command, CommandError, NoSimulatorError
from autodrive.connect.server import server as server_module
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import encode
from autodrive.protocol.messages import SetSpeed
from autodrive.world.simulation import Simulation
from tests.connect.client.conftest import bare
from tests.support.waiting import LIMIT, wait_until


def test_steps_of_a_client_give_the_bits_of_world_step(sim: Client) -> None:
    world = autodrive.make("mini_map")
    rng = np.random.default_rng(4)
    events = 0
    with sim.lockstep():
        frame = sim.reset(seed=11)
        assert encode(frame) == encode(world.reset(11))
        for _ in range(600):  # long enough to leave the road, and to have some scans
            throttle, steering = rng.uniform(0.6, 1.0), rng.uniform(0.0, 1.0)
            orders = {"V1": Command(throttle, steering, autodrive.Headlights.LOW)}
            frame = sim.step(orders)
            assert encode(frame) == encode(world.step(orders))
            events += len(frame.events)
    assert events > 0
    assert frame.vehicles["V1"].lidar is not None


def test_one_step_of_several_ticks_equals_several_steps(sim: Client) -> None:
    world = autodrive.make("mini_map")
    with sim.lockstep():
        sim.reset()
        frame = sim.step({"V1": Command(0.5)}, ticks=40)
    there = world.step({"V1": Command(0.5)})
    for _ in range(39):
        there = world.step()
    assert frame.tick == there.tick
    assert encode(frame.vehicles) == encode(there.vehicles)


def test_lockstep_pauses_and_resumes_a_running_simulation(sim: Client, simulation: Simulation) -> None:
    with sim.lockstep():
        assert simulation.is_paused
    assert not simulation.is_paused
    sim.pause()
    with sim.lockstep():
        sim.step()
    assert simulation.is_paused


def test_the_status_is_never_older_than_the_answer_to_a_pause_or_resume(sim: Client) -> None:
    for _ in range(50):
        sim.pause()
        assert sim.status.is_paused
        sim.resume()
        assert not sim.status.is_paused


def test_the_first_step_pauses_and_the_next_one_continues(sim: Client, simulation: Simulation) -> None:
    first = sim.step()
    assert simulation.is_paused
    assert sim.step().tick == first.tick + 1


def test_frames_are_complete_and_in_order(sim: Client) -> None:
    frames = list(itertools.islice(sim.frames(), 30))
    ticks = [frame.tick for frame in frames]
    assert ticks == sorted(set(ticks))
    scan = frames[-1].vehicles["V1"].lidar
    assert scan is not None
    assert frames[-1].time - scan.time < 0.2  # the LIDAR turns seven times a second


def test_wait_news_returns_once_for_each_update(sim: Client) -> None:
    first = sim.wait_news(LIMIT).update_count
    second = sim.wait_news(LIMIT).update_count
    assert second > first > 0


def test_frames_can_be_requested_at_a_lower_rate(sim: Client) -> None:
    start = time.monotonic()
    for _ in itertools.islice(sim.frames(rate=20.0), 11):
        pass
    assert time.monotonic() - start > 0.3  # ten intervals of 50 ms, the first two may be short; of each tick 0.1 s
    assert next(sim.frames()).tick > 0


def test_the_latest_frame_is_the_same_until_another_comes(sim: Client) -> None:
    sim.pause()
    assert sim.frame is sim.frame


def test_a_script_that_did_not_read_for_long_gets_a_fresh_frame(sim: Client, simulation: Simulation) -> None:
    simulation.request(SetSpeed(None)).result(LIMIT)
    start = simulation.frame.tick
    wait_until(lambda: simulation.frame.tick > start + 3000)  # some 5 MB: more than is kept on the way
    simulation.request(SetSpeed(1.0)).result(LIMIT)
    now = simulation.frame.tick
    assert sim.frame.tick >= now


def test_driving_moves_the_car_and_lights_its_lamps(sim: Client) -> None:
    start = sim.frame.vehicles["V1"].ips.position
    wait_until(lambda: drive(sim) and float(np.linalg.norm(sim.frame.vehicles["V1"].ips.position - start)) > 0.05)
    assert sim.frame.vehicles["V1"].lights.headlights == 1
    wait_until(lambda: sim.status.drivers == {"V1": "script"})
    sim.release("V1")
    wait_until(lambda: not sim.status.drivers)


def drive(sim: Client) -> bool:
    sim.drive("V1", throttle=np.float32(0.5), steering=0.1, headlights=1)  # type: ignore[arg-type]
    return True


def test_a_refused_drive_raises_at_the_next_call(sim: Client) -> None:
    sim.set_driving_mode("V1", False)
    sim.drive("V1", throttle=0.5)
    with pytest.raises(CommandError, match=r"manual mode .*: sim\.set_driving_mode\(vehicle, is_autonomous=True\)"):
        wait_until(lambda: not sim.wait())
    assert sim.frame.tick > 0  # once
    sim.drive("V9", throttle=0.5)
    with pytest.raises(CommandError, match="vehicle 'V9' is not known"):
        wait_until(lambda: not sim.wait())


def test_missing_images_explain_how_to_get_pictures(sim: Client) -> None:
    with pytest.raises(KeyError, match=r"Client\(picture_rate=10\) and client\.image"):
        _ = sim.wait().vehicles["V1"].cameras["front"]


def test_requests_are_executed(sim: Client, simulation: Simulation) -> None:
    assert not sim.set_scene_light(False).scene_light
    assert sim.pause().tick <= simulation.frame.tick
    there = sim.teleport("V1", 0.5, 0.25, 1.0).vehicles["V1"].pose.position
    assert there[:2] == pytest.approx([0.5, 0.25], abs=0.01)
    sim.set_speed(3.0)
    assert simulation.speed == 3.0
    assert not sim.set_driving_mode("V1", False).vehicles["V1"].is_autonomous
    assert sim.reset(seed=3).tick == 0
    sim.resume()
    wait_until(lambda: sim.frame.tick > 5)


def test_another_scenario_brings_its_own_frames(sim: Client) -> None:
    assert set(sim.scenarios) == {"mini_map", "boxes"}
    before = sim.scene
    frame = sim.load_scenario("boxes")
    assert frame.objects
    assert sim.scene is not before
    assert sim.wait().objects


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda sim: sim.load_scenario("minimap"), "scenario 'minimap' is not known.*mini_map"),
        (lambda sim: sim.connect_bridge(), "without a bridge"),
    ],
)
def test_a_refused_request_is_a_command_error_with_the_reason(sim: Client, ask: object, words: str) -> None:
    with pytest.raises(CommandError, match=words):
        ask(sim)  # type: ignore[operator]
    assert sim.reset().tick == 0  # the connection still works


def test_a_wait_during_a_pause_ends_with_the_reason(sim: Client) -> None:
    sim.pause()
    with pytest.raises(TimeoutError, match=r"no Frame came within 0\.2 s; the simulation is paused: sim\.resume"):
        sim.wait(timeout=0.2)


def test_a_picture_without_a_subscription_is_an_error_at_once(sim: Client) -> None:
    with pytest.raises(autodrive.AutodriveError, match="create the Client with a picture_rate"):
        sim.image("V1", "front")


def test_a_token_is_needed_where_there_is_one(simulation: Simulation) -> None:
    with SimulationServer(Served(simulation, bare), PageOptions(port=0, token="open-sesame-0123")) as server:
        for token in (None, "wrong"):
            with pytest.raises(autodrive.AutodriveError, match="needs its token"):
                Client(server.address, token=token, timeout=LIMIT)
        for address, token in ((server.url, None), (server.address, "open-sesame-0123")):
            with Client(address, token=token, timeout=LIMIT) as sim:
                assert sim.frame.vehicles


def test_a_disconnected_client_no_longer_drives(sim: Client, server: SimulationServer) -> None:
    with Client(server.address, timeout=LIMIT) as other:
        other.drive("V1", throttle=0.1)
    sim.drive("V1", throttle=0.1)
    wait_until(lambda: sim.status.drivers == {"V1": "script"})
    with pytest.raises(autodrive.AutodriveError, match="closed"):
        _ = other.frame


def test_a_client_waits_for_a_simulator_that_starts(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """However long that takes: by the clock of this client it is longer than it waits for an answer."""
    seconds, sent = itertools.count(), list[object]()
    clock = SimpleNamespace(monotonic=lambda: float(next(seconds)), sleep=time.sleep)
    monkeypatch.setattr("autodrive.connect.client.connection.time", clock)
    monkeypatch.setattr(server_module, "encode", lambda message: sent.append(message) or encode(message))
    with SimulationServer(None, PageOptions(port=0)) as server:

        def serve() -> None:
            wait_until(lambda: len(sent) > 15)
            server.serve(Served(simulation, bare))

        thread = threading.Thread(target=serve)
        thread.start()
        with Client(server.address, timeout=10.0) as sim:
            assert sim.scene.title
        thread.join()


def test_a_client_finds_a_restarted_simulator(simulation: Simulation) -> None:
    server = SimulationServer(Served(simulation, bare), PageOptions(port=0))
    server.start()
    with Client(server.address, name="script", timeout=LIMIT) as sim:
        wait_until(lambda: sim.frame.vehicles["V1"].lidar is not None)
        port = server.port
        server.close()
        timer = threading.Timer(
            0.5, (server := SimulationServer(Served(simulation, bare), PageOptions(port=port))).start
        )
        timer.start()
        assert sim.wait().vehicles["V1"].lidar is not None  # with the scans that were asked for
        timer.join()
        sim.step()
        server.close()
        with pytest.raises(NoSimulatorError, match=r"was lost"):
            sim.step()
