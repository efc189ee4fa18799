"""The node and those who are not ours: a devkit's simulator, another vendor's DDS, fingers on keys, a gamepad."""

from __future__ import annotations

import json
import math
import os
import pty
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from autodrive import Client
from tests.ros import ros2_tables
from tests.ros.ros2 import BUILT, VEHICLE, WHEELS, bridge, witness
from tests.ros.running import Running, Witness, await_that, client, free_port, simulator

PORT = free_port()
DEVKIT_PORT = free_port()

CYCLONE = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>40</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""It looks for others on this machine only, as ROS 2 does with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("others")


@pytest.fixture(scope="module")
def heard(ros2: dict[str, str], folder: Path) -> Iterator[Witness]:
    """Hears two nodes: /direct and /devkit, of one and the same simulator."""
    with (
        bridge(ros2, folder, "-r", "__ns:=/direct", port=PORT, publish_tf=False),
        bridge(ros2, folder, "-r", "__ns:=/devkit", mode="devkit", port=DEVKIT_PORT, publish_tf=False),
        witness(ros2, folder) as one,
    ):
        yield one


@pytest.fixture(scope="module")
def sim(heard: Witness, folder: Path) -> Iterator[Client]:
    run = simulator(folder, "tiny_town", "--devkit", f"127.0.0.1:{DEVKIT_PORT}", "--image-size", "160x90", port=PORT)
    with client(PORT) as one:
        yield one
    run.end(signal.SIGTERM)


def test_a_devkits_simulator_is_published_and_driven(heard: Witness, sim: Client) -> None:
    """Ours speaks as the original one: through the protocol of the devkits, with its profile of 2025."""
    root = f"/devkit{VEHICLE}"
    heard.listen(f"{root}/scan", "sensor_msgs/LaserScan")
    heard.listen(f"{root}/ips", "geometry_msgs/Point", "RELIABLE")
    heard.listen(f"{root}/rear_camera/image_raw", "sensor_msgs/Image")
    heard.say(f"{root}/throttle_command", "std_msgs/Float32", {"data": 0.5})
    await_that(lambda: sim.frame.vehicles["V1"].speed > 0.1)
    frame = sim.pause()

    def place() -> list[float]:
        told = heard.latest(f"{root}/ips")["message"]
        return [told[axis] for axis in "xyz"]

    await_that(lambda: place() == pytest.approx(frame.vehicles["V1"].ips.position, abs=6e-5))  # four decimals
    sim.resume()
    assert len(heard.latest(f"{root}/scan")["message"]["ranges"]) == 360

    def size() -> tuple[int, int]:
        picture = heard.latest(f"{root}/rear_camera/image_raw")["message"]
        return picture["width"], picture["height"]

    await_that(lambda: size() == (160, 90))  # before its first picture the simulator sends a black one
    heard.say(f"{root}/throttle_command", "std_msgs/Float32", None)
    await_that(lambda: abs(sim.frame.vehicles["V1"].speed) < 0.01)
    assert not [name for name in heard.services() if name == "/devkit/step_simulation"]


def test_another_vendors_dds_reads_the_scan(ros2: dict[str, str], heard: Witness, sim: Client) -> None:
    scan = sim.frame.vehicles["V1"].lidar
    script = Path(__file__).parent / "ros2_cyclone.py"
    done = subprocess.run(
        [WHEELS / "bin" / "python", script, f"/direct{VEHICLE}/scan", ros2["ROS_DOMAIN_ID"]],
        env=ros2 | {"CYCLONEDDS_URI": CYCLONE},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    frame_id, _, increment, ranges = json.loads(done.stdout)
    assert scan is not None
    assert (frame_id, len(ranges)) == ("lidar", len(scan.ranges))
    assert increment == pytest.approx(scan.angle_increment, rel=1e-6)
    assert sum(0.1 < one < 12.0 for one in ranges) > 100


def test_keys_drive(ros2: dict[str, str], heard: Witness, sim: Client, folder: Path) -> None:
    ours, theirs = pty.openpty()
    program = BUILT / "install" / "lib" / "autodrive_ros2" / "teleop_keyboard"
    with Running(ros2, folder, program, "--ros-args", "-r", "__ns:=/devkit", stdin=theirs) as running:
        await_that(lambda: "Ctrl-C" in running.words.read_text())
        os.write(ours, b"wwa")
        await_that(lambda: sim.frame.vehicles["V1"].throttle == pytest.approx(0.4))
        await_that(lambda: sim.frame.vehicles["V1"].steering == pytest.approx(0.2 * 0.5236, abs=2e-3))
        os.write(ours, b"x")
        await_that(lambda: sim.frame.vehicles["V1"].throttle == 0.0)
        running.process.send_signal(signal.SIGINT)
        assert running.process.wait(10.0) == 0


def test_a_gamepad_drives_while_its_button_is_held(
    ros2: dict[str, str], heard: Witness, sim: Client, folder: Path
) -> None:
    program = BUILT / "install" / "lib" / "autodrive_ros2" / "teleop_joy"
    with Running(ros2, folder, program, "--ros-args", "-r", "__ns:=/devkit"):
        pushed = {"axes": [0.0, 1.0, 0.0, -0.5], "buttons": [0, 0, 0, 0, 1]}
        heard.say("/devkit/joy", "sensor_msgs/Joy", pushed)
        await_that(lambda: sim.frame.vehicles["V1"].throttle > 0.9)
        await_that(lambda: sim.frame.vehicles["V1"].steering == pytest.approx(-0.25, abs=0.02))
        heard.say("/devkit/joy", "sensor_msgs/Joy", pushed | {"buttons": [0] * 5})
        await_that(lambda: sim.frame.vehicles["V1"].throttle == 0.0)
        heard.say("/devkit/joy", "sensor_msgs/Joy", None)


def test_the_program_of_the_document_drives_and_stops_before_what_is_in_the_way(
    ros2: dict[str, str], heard: Witness, sim: Client, folder: Path
) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", ros2_tables.DOCUMENT.read_text(), flags=re.DOTALL)
    program = folder / "careful.py"
    program.write_text(code)
    sim.reset()
    x, y, _ = sim.frame.vehicles["V1"].pose.position
    sim.teleport("V1", x + 0.4, y, math.pi)  # a wall is behind the start
    with Running(ros2, folder, WHEELS / "bin" / "python", program, "--ros-args", "-r", "__ns:=/devkit"):
        await_that(lambda: sim.frame.vehicles["V1"].speed > 0.1)
        await_that(lambda: abs(sim.frame.vehicles["V1"].speed) < 0.01)
        car = sim.frame.vehicles["V1"]
        assert car.collision_count == 0
        assert car.lidar is not None
        assert 0.25 < min(*car.lidar.ranges[:20], *car.lidar.ranges[-20:]) < 0.5


def test_the_tables_of_the_document_are_those_of_the_code(ros2: dict[str, str]) -> None:
    """If not:  python -m tests.ros.ros2_tables"""
    text = ros2_tables.DOCUMENT.read_text()
    assert ros2_tables.rewritten(text, ros2_tables.tables(ros2)) == text


def test_without_the_optional_packages_it_runs_and_says_what_it_lacks(ros2: dict[str, str], folder: Path) -> None:
    """simulation_interfaces and ackermann_msgs are hidden from it."""
    hidden = folder / "hidden"
    for package in ("simulation_interfaces", "ackermann_msgs"):
        (hidden / package).mkdir(parents=True)
        (hidden / package / "__init__.py").write_text("raise ImportError('hidden')\n")
    environment = ros2 | {"PYTHONPATH": f"{hidden}:{ros2['PYTHONPATH']}"}
    with bridge(environment, folder, port=free_port()) as running:
        await_that(lambda: "no simulator" in running.words.read_text())
        words = running.words.read_text()
        assert "without services: the package simulation_interfaces is missing" in words
        assert "without topic autodrive/nigel_1/drive" in words


def test_a_parameter_that_does_not_fit_is_one_line(ros2: dict[str, str], folder: Path) -> None:
    with bridge(ros2, folder, profile="2019") as running:
        assert running.process.wait(20.0) == 1
        assert running.words.read_text() == (
            "autodrive_bridge: profile must be one of 2020, 2022, 2023, 2025, not '2019'\n"
        )
