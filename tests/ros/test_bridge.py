"""The bridge against a running simulator, in both of its languages: what ROS is told is what the Frame says."""

from __future__ import annotations

import json
import math
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import connect

import autodrive
from autodrive import AutodriveError, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from autodrive.protocol.devkit import PROFILES
from autodrive.protocol.messages import Frame, LoadScenario, Pause, Reset, Resume, SetDrivingMode, Step, VehicleFrame
from autodrive.ros import Bridge, Config, Message
from autodrive.scenery import Scenery
from autodrive.transforms import rotate
from autodrive.vehicles.spec import load_vehicle
from tests.bridge.conftest import PATIENCE, eventually, free_port
from tests.client.conftest import started
from tests.ros.frames import Tree, matrix
from tests.ros.recorder import Recorder

ROOT = Path(__file__).parents[2]
URDF = (ROOT / "ros/autodrive_description/urdf/nigel.urdf").read_text()
NIGEL = load_vehicle("nigel")
SCENARIOS = {"mini_map": "Mini-map", "two_cars": "Two cars"}


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    with Simulation(started(autodrive.make("mini_map")), load=lambda name: started(autodrive.make(name))) as one:
        yield one


@pytest.fixture(scope="module")
def server(simulation: Simulation) -> Iterator[Server]:
    with served(simulation) as one:
        yield one


def served(simulation: Simulation, port: int = 0) -> Server:
    return Server(simulation, scenery=lambda world: Scenery.of(world, world.spec.title), scenarios=SCENARIOS, port=port)


@pytest.fixture(autouse=True)
def fresh(simulation: Simulation) -> None:
    simulation.request(SetDrivingMode("V1", False)).result(PATIENCE)
    simulation.request(Reset()).result(PATIENCE)
    simulation.request(Resume()).result(PATIENCE)


@pytest.fixture
def node() -> Recorder:
    return Recorder()


@pytest.fixture
def bridge(server: Server, node: Recorder) -> Iterator[Bridge]:
    with running(Config(port=server.port, robot_description=URDF), node) as one:
        eventually(lambda: "/tf" in node.messages)
        yield one


class running:  # noqa: N801 - reads as a word
    """A bridge that is started, and closed in the end."""

    def __init__(self, config: Config, node: Recorder) -> None:
        self._bridge = Bridge(config, node)

    def __enter__(self) -> Bridge:
        self._bridge.start()
        return self._bridge

    def __exit__(self, *_: object) -> None:
        self._bridge.close()


def halted(simulation: Simulation, node: Recorder, command: autodrive.Command) -> tuple[Frame, VehicleFrame]:
    """After a drive of 40 ticks with that command the world stands still, and the node has told so."""
    simulation.request(Pause()).result(PATIENCE)
    for _ in range(3):
        simulation.request(Step(10, {"V1": command})).result(PATIENCE)
    frame = simulation.request(Step(10, {"V1": command})).result(PATIENCE)
    eventually(lambda: seconds(node.last("odom")["header"]["stamp"]) == pytest.approx(frame.time, abs=1e-9))
    return frame, frame.vehicles["V1"]


def seconds(stamp: Any) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec


def vector(fields: dict[str, float]) -> list[float]:
    return [*fields.values()]


def tree(node: Recorder) -> Tree:
    return Tree(*(Message("", node.last(name)) for name in ("/tf_static", "/tf")))


# -- direct: all of a Frame -----------------------------------------------------------------------------------------


def test_every_reading_is_told_as_the_frame_has_it(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    frame, vehicle = halted(simulation, node, autodrive.Command(-0.7, 0.5, 2, 1))  # type: ignore[arg-type]
    assert node.last("throttle")["data"] == vehicle.throttle == -0.7
    assert node.last("steering")["data"] == vehicle.steering > 0.2
    assert node.last("speed")["data"] == -vehicle.speed > 0.01
    for i, side in enumerate(("left", "right")):
        told = node.last(f"{side}_encoder")
        assert told["position"] == pytest.approx([vehicle.encoders.angles[i]])
        assert told["name"] == [f"{side}_encoder"]
    assert vector(node.last("ips")) == pytest.approx(vehicle.ips.position)
    for name in ("imu", "imu/data"):
        imu = node.last(name)
        assert vector(imu["orientation"]) == pytest.approx(np.roll(vehicle.imu.orientation, -1))
        assert vector(imu["angular_velocity"]) == pytest.approx(vehicle.imu.angular_velocity)
        assert vector(imu["linear_acceleration"]) == pytest.approx(vehicle.imu.linear_acceleration)
        assert seconds(imu["header"]["stamp"]) == pytest.approx(vehicle.imu.time)
    truth = node.last("ground_truth/odom")
    assert vector(truth["pose"]["pose"]["position"]) == pytest.approx(vehicle.pose.position)
    assert vector(truth["twist"]["twist"]["linear"]) == pytest.approx(vehicle.velocity)
    lights = node.last("lights")
    assert (lights["headlights"], lights["indicators"], lights["reverse_lights"]) == (2, 1, True)
    assert node.last("wheels")["normal_load"] == pytest.approx(vehicle.wheels.normal_load)
    assert seconds(node.last("/clock")["clock"]) == pytest.approx(frame.time)


def test_the_scan_is_told_as_the_frame_has_it(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    _, vehicle = halted(simulation, node, autodrive.Command())
    assert vehicle.lidar is not None
    for name in ("lidar", "scan"):
        told = node.last(name)
        assert told["ranges"] == pytest.approx(vehicle.lidar.ranges.astype(np.float32))
        assert seconds(told["header"]["stamp"]) == pytest.approx(vehicle.lidar.time)
    assert len(node.messages["autodrive/nigel_1/scan"]) == len(node.messages["autodrive/nigel_1/lidar"])


def test_frames_stand_where_the_vehicle_is(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    _, vehicle = halted(simulation, node, autodrive.Command(0.9, -0.6))
    frames = tree(node)
    truth = matrix(vehicle.pose.position, np.roll(vehicle.pose.orientation, -1))
    assert frames.pose("world", "base_link") == pytest.approx(truth, abs=1e-9)
    assert frames.pose("map", "nigel_1") == pytest.approx(truth, abs=1e-9)
    mount = NIGEL.sensors.lidar and NIGEL.sensors.lidar.mount
    assert mount is not None
    lidar = matrix(mount.position, np.roll(mount.orientation, -1))
    assert frames.pose("base_link", "lidar") == pytest.approx(lidar, abs=1e-6)
    left = frames.pose("base_link", "front_left_wheel")
    assert left[:3, 3] == pytest.approx((NIGEL.wheelbase, NIGEL.track / 2, 0.0), abs=1e-6)
    assert math.atan2(-left[0, 1], left[1, 1]) == pytest.approx(vehicle.wheels.steering_angle[0], abs=1e-6)
    assert frames.pose("map", "odom") @ frames.pose("odom", "base_link") == pytest.approx(truth, abs=1e-9)


def test_odometry_is_nearly_the_truth_after_a_short_drive(
    simulation: Simulation, bridge: Bridge, node: Recorder
) -> None:
    before = tree(node).pose("map", "base_link")
    _, vehicle = halted(simulation, node, autodrive.Command(0.8, 0.3))
    driven = np.linalg.norm(vehicle.pose.position - before[:3, 3])
    odom = node.last("odom")["pose"]["pose"]["position"]
    assert math.hypot(odom["x"], odom["y"]) == pytest.approx(driven, rel=0.25)


@pytest.mark.parametrize(
    ("profile", "root", "steering"),
    [("2020", "ego_vehicle", "steering_angle"), ("2022", "v1", "steering"), ("2023", "nigel_1", "steering")],
)
def test_names_and_signs_are_those_of_the_era(
    simulation: Simulation, server: Server, node: Recorder, profile: str, root: str, steering: str
) -> None:
    era = PROFILES[profile]
    with running(Config(port=server.port, profile=profile, robot_description=URDF), node):
        eventually(lambda: f"autodrive/{root}/lidar" in node.messages)
        simulation.request(Pause()).result(PATIENCE)
        vehicle = simulation.request(Step(20, {"V1": autodrive.Command(0.0, 1.0)})).result(PATIENCE).vehicles["V1"]
        told = f"autodrive/{root}/{steering}"
        eventually(lambda: node.last(told)["data"] == era.feedback_sign * vehicle.steering)
        frames = tree(node)
        assert frames.pose("base_link", root)[:3, 3] == pytest.approx(era.origin)
        assert frames.pose("map", root)[:3, 3] == pytest.approx(vector(node.last(f"autodrive/{root}/ips")))
        begin = node.last(f"autodrive/{root}/lidar")["angle_min"]
        ahead = frames.pose("base_link", "lidar")[:3, :3] @ (math.cos(begin), math.sin(begin), 0.0)
        assert ahead == pytest.approx((1.0, 0.0, 0.0), abs=1e-6), "ray 0 looks ahead"


# -- direct: driving and asking -------------------------------------------------------------------------------------


def test_throttle_and_steering_drive_and_silence_stops(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    def driven() -> bool:
        node.say("nigel_1/throttle_command", data=0.8)
        node.say("nigel_1/steering_command", data=1.0)
        now = simulation.frame.vehicles["V1"]
        return now.speed > 0.2 and now.steering > 0.4

    eventually(driven)
    assert simulation.frame.vehicles["V1"].is_autonomous, "the command took over"
    eventually(lambda: abs(simulation.frame.vehicles["V1"].speed) < 0.001)


def test_lamps_are_switched(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    node.say("nigel_1/headlights_command", data=1)
    node.say("nigel_1/indicators_command", data=3)
    eventually(lambda: [*map(int, _lamps(simulation))] == [1, 3])


def _lamps(simulation: Simulation) -> tuple[int, int]:
    lights = simulation.frame.vehicles["V1"].lights
    return lights.headlights, lights.indicators


def test_an_initial_pose_puts_the_vehicle_there(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    simulation.request(Pause()).result(PATIENCE)
    spot = SimpleNamespace(x=1.0, y=0.1, z=0.0)
    turn = SimpleNamespace(x=0.0, y=0.0, z=math.sin(0.5), w=math.cos(0.5))
    node.say("nigel_1/initialpose", pose=SimpleNamespace(pose=SimpleNamespace(position=spot, orientation=turn)))
    pose = simulation.frame.vehicles["V1"].pose
    assert pose.position[:2] == pytest.approx((1.0, 0.1), abs=1e-6)
    assert 2 * math.atan2(pose.orientation[3], pose.orientation[0]) == pytest.approx(1.0)


def test_a_reset_begins_anew_and_odometry_too(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    halted(simulation, node, autodrive.Command(0.9))
    assert node.last("odom")["pose"]["pose"]["position"]["x"] > 0.01
    node.say("nigel_1/reset_command", data=True)
    eventually(lambda: node.last("odom")["pose"]["pose"]["position"]["x"] == 0.0)


def test_what_is_refused_is_said(bridge: Bridge) -> None:
    with pytest.raises(AutodriveError, match="aused"):
        bridge.ask(Step(1))


def test_another_scenario_brings_its_vehicles(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    assert bridge.ask(LoadScenario("two_cars"))
    eventually(lambda: "autodrive/nigel_2/odom" in node.messages)
    frames = tree(node)
    assert frames.pose("map", "nigel_2/lidar").shape == (4, 4)
    node.say("nigel_2/throttle_command", data=1.0)
    eventually(lambda: simulation.frame.vehicles["V2"].throttle == 1.0)
    assert bridge.ask(LoadScenario("mini_map"))
    eventually(lambda: [*simulation.frame.vehicles] == ["V1"])


def test_a_simulator_that_is_started_anew_is_found_again(simulation: Simulation, node: Recorder) -> None:
    port = free_port()
    with running(Config(port=port, robot_description=URDF), node):
        for _ in range(2):
            before = len(node.messages.get("/tf", []))
            with served(simulation, port):
                eventually(lambda before=before: len(node.messages.get("/tf", [])) > before + 3)


def test_pictures_nobody_reads_are_not_asked_for(simulation: Simulation, server: Server) -> None:
    node = Recorder(unread="camera")
    with running(Config(port=server.port, robot_description=URDF), node) as bridge:
        eventually(lambda: "/tf" in node.messages)
        assert not bridge.wants_pictures


# -- devkit: any simulator ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", [*PROFILES])
def test_the_devkits_texts_are_told_as_the_frame_has_them(simulation: Simulation, profile: str) -> None:
    node, port = Recorder(), free_port()
    root = f"autodrive/{Config(profile=profile).name(1)}"
    simulation.request(SetDrivingMode("V1", True)).result(PATIENCE)
    config = Config(mode="devkit", port=port, profile=profile, robot_description=URDF)
    with running(config, node), DevkitBridge(simulation, port=port, profile=profile):

        def driven() -> bool:
            for name, value in (("throttle", 0.8), ("steering", 0.5)):
                node.subscriptions[f"{root}/{name}_command"].take(SimpleNamespace(data=value))
            return simulation.frame.vehicles["V1"].speed > 0.2 and f"{root}/lidar" in node.messages

        eventually(driven)
        side = PROFILES[profile].command_sign
        assert side * simulation.frame.vehicles["V1"].steering > 0.2
        frame = simulation.request(Pause()).result(PATIENCE)
        vehicle = frame.vehicles["V1"]
        ips, lever = f"{root}/ips", PROFILES[profile].origin
        expected = vehicle.pose.position + rotate(vehicle.pose.orientation, lever)
        eventually(lambda: vector(node.last(ips)) == pytest.approx(expected, abs=1e-3))
        assert node.last(f"{root}/throttle")["data"] == pytest.approx(vehicle.throttle, abs=1e-3)
        assert node.last(f"{root}/imu")["angular_velocity"]["z"] == pytest.approx(
            vehicle.imu.angular_velocity[2], abs=2e-3
        )
        truth = matrix(vehicle.pose.position, np.roll(vehicle.pose.orientation, -1))
        assert tree(node).pose("map", "base_link") == pytest.approx(truth, abs=2e-3)
        told = vehicle.lidar
        assert told is not None
        assert node.last(f"{root}/lidar")["ranges"] == pytest.approx(told.ranges, rel=1e-6)
        image = node.last(f"{root}/front_camera")
        assert len(image["data"]) == 3 * image["width"] * image["height"] > 0


def test_a_message_recorded_of_the_original_simulator_is_told_and_answered(node: Recorder) -> None:
    """It speaks at once, before any greeting, and waits for an answer to each of its messages."""
    recorded = json.loads((ROOT / "tests/protocol/data/devkit_2023.json").read_text(encoding="utf-8"))["telemetry"]
    port = free_port()
    with running(Config(mode="devkit", port=port, profile="2023", robot_description=URDF), node):
        eventually(lambda: _is_open(port))
        url = f"ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket"
        with connect(url, compression=None, max_size=None) as original:
            for throttle in (0.0, 0.25):
                original.send("42" + json.dumps(["Bridge", recorded]))
                answer = next(text for text in original if str(text).startswith("42"))
                event, commands = json.loads(str(answer)[2:])
                assert float(commands["V1 Throttle"]) == throttle
                node.say("nigel_1/throttle_command", data=0.25)
                node.say("nigel_1/steering_command", data=-1.0)
    assert event == "Bridge"
    assert float(commands["V1 Steering"]) == -1.0
    assert {"V1 Headlights", "V1 Indicators", "TL1 State", "TL4 State"} <= commands.keys()
    assert vector(node.last("ips")) == pytest.approx((-1.1, 0.15, 0.033))
    assert node.last("lidar")["ranges"][:3] == pytest.approx([math.inf, 1.008726, 1.01745])
    assert node.last("lidar")["angle_min"] == pytest.approx(-math.pi)
    assert node.last("autodrive/signal_1/state")["data"] == 0


def test_a_simulator_is_answered_at_the_rate_that_is_wanted(node: Recorder) -> None:
    port = free_port()
    with running(Config(mode="devkit", port=port, rate=50.0), node):
        eventually(lambda: _is_open(port))
        with connect(f"ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket", compression=None) as peer:
            begin, count = time.monotonic(), 0
            peer.send('42["Bridge",{"V1 Position":"0 0 0"}]')
            while time.monotonic() < begin + 0.5:
                if str(peer.recv()).startswith("42"):
                    count += 1
                    peer.send('42["Bridge",{"V1 Position":"0 0 0"}]')
    assert 2 <= count <= 26


NONSENSE = [
    {"V1 Position": "here"},
    {"V1 Position": "0 0 0", "V1 Encoder Angles": "nan"},
    {"V1 Position": "0 0 0", "V1 Throttle": "full"},
    {"V1 Position": "0 0 0", "V1 LIDAR Range Array": "H4sI"},
    {"V1 Position": "0 0 0", "V1 Orientation Quaternion": "0 0 0 0", "TL1 State": "red"},
    {"V1 Position": "0 0 0", "V1 Front Camera Image": "%%%"},
    {"V1 Position": ["0"], "V1 Speed": {}},
]


@pytest.mark.parametrize("nonsense", NONSENSE, ids=str)
def test_nonsense_is_answered_and_what_follows_is_told(node: Recorder, nonsense: dict[str, Any]) -> None:
    port = free_port()
    with running(Config(mode="devkit", port=port, robot_description=URDF), node):
        eventually(lambda: _is_open(port))
        with connect(f"ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket", compression=None) as peer:
            for data in (nonsense, {"V1 Position": "1 2 0.5", "V1 Throttle": "0.5"}):
                peer.send("42" + json.dumps(["Bridge", data]))
                assert "V1 Throttle" in next(str(text) for text in peer if str(text).startswith("42"))
        eventually(lambda: vector(node.last("ips")) == [1.0, 2.0, 0.5])


def _is_open(port: int) -> bool:
    with socket.socket() as one:
        return one.connect_ex(("127.0.0.1", port)) == 0


def test_in_devkit_mode_there_are_no_requests() -> None:
    bridge = Bridge(Config(mode="devkit"), Recorder())
    with pytest.raises(AutodriveError, match="mode 'direct'"):
        bridge.ask(Reset())


# -- bad input ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"mode": "magic"}, "mode must be"),
        ({"profile": "1999"}, "profile must be"),
        ({"port": 70000}, "port must be"),
        ({"rate": 0.0}, "rate must be"),
        ({"command_timeout": math.nan}, "command_timeout must be"),
        ({"picture_quality": 0}, "picture_quality must be"),
    ],
)
def test_what_does_not_fit_is_said(wrong: dict[str, Any], words: str) -> None:
    with pytest.raises(AutodriveError, match=words):
        Config(**wrong)


@pytest.mark.parametrize("text", ["", "<robot", "<robot><joint/></robot>", "no xml"])
def test_what_is_no_urdf_is_said(text: str) -> None:
    if text:
        with pytest.raises(AutodriveError, match="no URDF"):
            Bridge(Config(robot_description=text), Recorder())
    else:
        assert Bridge(Config(), Recorder()).frame is None
