"""Two hundred hostile connections: the run goes on as if they were not there, and others are served."""

from __future__ import annotations

import hashlib
import json
import math
import signal
import time
from pathlib import Path
from statistics import median

import pytest

import autodrive
from autodrive import Command, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.server import hub
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import Frame
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from tests.support.attackers import CROWD, POWERLESS
from tests.support.command_line import Started
from tests.support.frames import bytes_of
from tests.support.hardening import attackers, cases, memory, open_files
from tests.support.native_clients import NativeClient, connected, scene_files
from tests.support.waiting import free_port, wait_until


@pytest.mark.process
def test_a_run_goes_on_beside_two_hundred_connections(tmp_path: Path) -> None:
    port, summary = free_port(), tmp_path / "s.json"
    arguments = ("--port", str(port), "--no-browser", "--no-cameras", "--summary", str(summary))
    run = Started(tmp_path, "run", "plane", *arguments)
    run.wait_for("press Ctrl-C to stop")
    pid = run.process.pid
    try:
        with connected(port) as before, attackers(port, CROWD):
            _watch(before, cases(0.0, 20.0))  # until the buffers of all connections are in use
            start = memory(pid)
            with connected(port) as honest:
                factors = [
                    one for _ in range(cases(1, 35)) for who in (honest, before) for one in _watch(who, cases(0.0, 1.0))
                ]
                if cases(short=False, long=True):
                    end = memory(pid)
                    print(f"memory {start:.1f} MB, then {end:.1f} MB")
                    print(f"real-time factors: median {median(factors):.4f}, least {min(factors):.4f}")
                    assert end < 1.05 * start
        wait_until(lambda: open_files(pid) < 50)
    finally:
        code = run.end(signal.SIGTERM)
    assert code == 0, run.messages.read_text()
    assert "Traceback" not in run.messages.read_text()
    print(f"{json.loads(summary.read_text())['real_time_factor']:.4f} real-time factor of the run")


def _watch(client: NativeClient, seconds: float) -> list[float]:
    """Receive Frames of so much wall time and 60 ticks at least; the real-time factors that were reported."""
    end = time.monotonic() + seconds
    factors, tick, passed = [], client.until("Frame")["tick"], 0
    while time.monotonic() < end or passed < 60:
        message = client.receive()
        if message["type"] == "Status":
            factors.append(message["real_time_factor"])
        elif message["type"] == "Frame":
            passed += max(message["tick"] - tick, 0)  # others reset the world all the time
            tick = message["tick"]
    return factors


class Driver:
    """Sink: drives the car by the number of the tick, and adds each Frame to a hash."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._hash = hashlib.sha256()
        self.wait = lambda: None
        """Called every 50 ticks."""

    def publish(self, frame: Frame) -> None:
        for data in bytes_of(frame):
            self._hash.update(data)
        command = Command(throttle=0.6 * math.cos(0.01 * frame.tick), steering=math.sin(0.03 * frame.tick))
        self._simulation.submit("V1", command, "person")
        if frame.tick % 50 == 0:
            self.wait()

    @property
    def digest(self) -> str:
        return self._hash.hexdigest()


def _states(simulation: Simulation, driver: Driver) -> str:
    """The hash of all states of a run."""
    simulation.add_sink(driver)
    driver.publish(simulation.world.frame)
    ticks = cases(150, 20_000)
    simulation.run(ticks * simulation.world.tick_duration)
    assert simulation.frame.tick == ticks
    assert math.hypot(*simulation.frame.vehicles["V1"].pose.position[:2]) > 0.05  # it was driven
    return driver.digest


def test_who_may_not_influence_a_run_leaves_its_states_the_same_to_the_last_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Neither do viewers that flood the server, nor a script while a person drives."""
    scenario = ScenarioSpec(vehicles={"V1": VehiclePlacement(is_autonomous=False)}, boxes={"a": BoxSpec(x=0.4, y=0.0)})
    quiet = Simulation(autodrive.make(scenario), speed=None)
    expected = _states(quiet, Driver(quiet))

    received = []
    decoded = hub.decoded
    monkeypatch.setattr(hub, "decoded", lambda data: (received.append(1), decoded(data))[1])
    simulation = Simulation(autodrive.make(scenario), speed=None)
    driver, port = Driver(simulation), free_port()
    viewers = {role: cases(max(count // 10, 1), count) for role, count in POWERLESS.items()}
    with (
        SimulationServer(Served(simulation, scene_files), PageOptions(port=free_port())) as server,
        attackers(port, {"orders": 1}),
        DevkitBridge(simulation, port=port) as bridge,
        attackers(server.port, viewers),
    ):

        def wait() -> None:
            """Until the attackers have sent more."""
            messages, commands = len(received) + 20, bridge.counters.commands_received + 5
            wait_until(lambda: len(received) > messages and bridge.counters.commands_received > commands)

        driver.wait = wait
        assert _states(simulation, driver) == expected
