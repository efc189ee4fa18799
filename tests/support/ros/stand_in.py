"""A stand-in for a real car: a simulator with hidden parameters that a deployed policy reaches by ROS 2 only."""

from __future__ import annotations

import os
import signal
import subprocess
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import IO, Any

import yaml

from autodrive.experiments.deployment.deploy import deploy
from autodrive.scenario.kinds import find
from tests.support.ros.processes import Program, simulator
from tests.support.ros.ros2 import ENVIRONMENT, bridge, probe
from tests.support.waiting import free_port

CAR = "/autodrive/roboracer_1"
GRIP, LATENCY, OFFSET = 0.75, 0.040, 1.5
"""Hidden: factor of the friction of the tyres, dead time of drive and steering [s], offset of the steering [degree]."""
LIDAR = {"rays": 720, "angle_min_deg": -180.0, "angle_increment_deg": 0.5, "range_max": 12.0}
"""Layout of its scanner: a circle with half of the rays and a longer range."""
TOPICS = {
    "odometry_topic": f"{CAR}/odom",
    "imu_topic": f"{CAR}/imu",
    "pose_topic": f"{CAR}/ground_truth/odom",
    "pose_type": "Odometry",
    "drive_topic": f"{CAR}/drive",
}


def hidden_vehicle(folder: Path) -> Path:
    """A file of the car RoboRacer with the hidden parameters, but for the grip."""
    vehicle = yaml.safe_load(find("vehicle", "roboracer").read_text(encoding="utf-8"))
    vehicle["title"] = "Stand-in for a real car"
    vehicle["steering"] |= {"dead_time": LATENCY, "offset_deg": OFFSET}
    vehicle["drivetrain"] |= {"dead_time": LATENCY}
    vehicle["sensors"]["lidar"] |= LIDAR
    file = folder / "roboracer_hidden.yaml"  # the first word is the name in ROS
    file.write_text(yaml.safe_dump(vehicle), encoding="utf-8")
    return file


def scenario(folder: Path, track: str, laps: int) -> Path:
    """A race of the stand-in, on its own."""
    car = {"type": str(hidden_vehicle(folder)), "grip_factor": GRIP, "has_realistic_sensors": True}
    text = {"map": track, "vehicles": {"V1": car}, "tick": 0.005, "race": {"rules": "practice", "laps": laps}}
    file = folder / f"{track}.yaml"
    file.write_text(yaml.safe_dump(text), encoding="utf-8")
    return file


class DrivenStandIn:
    """The simulator, the bridge, a gate for the scans, and the node of a deployed policy, each a process of its own."""

    def __init__(
        self,
        environment: dict[str, str],
        folder: Path,
        track: str,
        *,
        policy: str = "race",
        vehicle: str = "roboracer",
        laps: int = 10,
        speed: float = 1.0,
        settings: tuple[str, ...] = (),
        arguments: tuple[str, ...] = (),
    ) -> None:
        """`speed`: simulated seconds per second. `settings`: NAME=VALUE. `arguments`: of the node."""
        changes = [f"{name}={value}" for name, value in {**TOPICS, "log": str(folder / "drive.csv")}.items()]
        deploy(policy, folder / "car", vehicle=vehicle, changes=[*changes, *settings])
        self.port, self.folder, self.log = free_port(), folder, folder / "drive.csv"
        python = ENVIRONMENT / "bin" / "python"
        with ExitStack() as stack:
            self._bridge = stack.enter_context(
                bridge(environment, folder, port=self.port, rate=50.0, vehicle_type="roboracer")
            )
            options = ("--no-cameras", "--speed", str(speed), "--seed", "3")
            self._simulator = simulator(folder, str(scenario(folder, track, laps)), *options, port=self.port)
            stack.callback(self._simulator.stop, signal.SIGTERM)
            gate = Path(__file__).with_name("ros2_scan_gate.py")
            self._gate = subprocess.Popen(
                [python, gate, f"{CAR}/scan", "/scan"],
                env=environment | {"ROS_LOG_DIR": str(folder)},
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            stack.callback(self._gate.terminate)
            assert _line(self._gate.stdout) == "ready"
            self.probe = stack.enter_context(probe(environment, folder))
            node = folder / "car" / "ros2_node.py"
            self.node = Program(environment, folder, python, node, *arguments, "--ros-args", "-p", "use_sim_time:=true")
            stack.callback(self.node.stop)
            self._stack = stack.pop_all()

    def __enter__(self) -> DrivenStandIn:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def press(self, is_pressed: bool) -> None:
        """Press the dead man's button, or release it."""
        self.probe.publish("/dead_man", "std_msgs/Bool", {"data": is_pressed})

    def turn_gate(self) -> float:
        """Close or open the gate of the scans; the stamp of the last one that went through [s]."""
        assert self._gate.stdin is not None
        self._gate.stdin.write("\n")
        self._gate.stdin.flush()
        return float(_line(self._gate.stdout))

    def processor_time(self) -> float:
        """Processor time of the node up to now [s]."""
        fields = Path(f"/proc/{self.node.process.pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _line(stream: IO[Any] | None) -> str:
    assert stream is not None
    return str(stream.readline()).strip()
