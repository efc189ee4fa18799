"""The bridge without ROS, against a running simulator with both protocols: published messages equal the Frame."""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from websockets.sync.client import connect

import autodrive
from autodrive import AutodriveError, Command, Simulation
from autodrive.base.transforms import rotate
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.ros import Bridge, Config, Message
from autodrive.connect.ros.cars import CARS, Car
from autodrive.connect.ros.devkit_source import DevkitSource
from autodrive.connect.ros.source import Update, VehicleInfo
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.devkit import black_image
from autodrive.protocol.devkit_profile import PROFILES, DevkitSettings
from autodrive.protocol.messages import (
    Frame,
    LoadScenario,
    Pause,
    Reset,
    Resume,
    SetDrivingMode,
    Step,
    Teleport,
    VehicleFrame,
)
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.vehicles.spec import load_vehicle
from autodrive.world.views.scene_files import SceneFiles
from tests.connect.client.conftest import started
from tests.support.ros.recorder import Recorder, running
from tests.support.ros.transform_tree import Tree, matrix
from tests.support.waiting import LIMIT, free_port, is_listening, wait_until

ROOT = Path(__file__).parents[3]
URDF = (ROOT / "ros/autodrive_description/urdf/nigel.urdf").read_text()
NIGEL = load_vehicle("nigel")
CAR = "autodrive/nigel_1"
SCENARIOS = {"mini_map": "Mini-map", "two_cars": "Two cars"}


@pytest.fixture(scope="module")
def simulation() -> Iterator[Simulation]:
    with Simulation(started(autodrive.make("mini_map")), load=lambda name: started(autodrive.make(name))) as one:
        yield one


@pytest.fixture(scope="module")
def server(simulation: Simulation) -> Iterator[SimulationServer]:
    with served(simulation) as one:
        yield one


def served(simulation: Simulation, port: int = 0) -> SimulationServer:
    return SimulationServer(
        Served(simulation, lambda world: SceneFiles.of(world, world.spec.title), scenarios=SCENARIOS),
        PageOptions(port=port),
    )


@pytest.fixture(autouse=True)
def fresh(simulation: Simulation) -> None:
    simulation.request(SetDrivingMode("V1", False)).result(LIMIT)
    simulation.request(Reset()).result(LIMIT)
    simulation.request(Resume()).result(LIMIT)


@pytest.mark.parametrize("host", ["::1", "[::1]"])
def test_the_address_of_an_ipv6_host_has_brackets(host: str) -> None:
    assert Config(host=host, port=9000).address == "[::1]:9000"
    assert Config(mode="devkit", host=host).address == "[::1]:4567"


@pytest.fixture
def node() -> Recorder:
    return Recorder()


@pytest.fixture
def bridge(server: SimulationServer, node: Recorder) -> Iterator[Bridge]:
    with running(Config(port=server.port, robot_description=URDF), node) as one:
        wait_until(lambda: f"{CAR}/wheels" in node.messages)
        yield one


def after_drive(simulation: Simulation, node: Recorder, command: autodrive.Command) -> tuple[Frame, VehicleFrame]:
    """Drive for 40 ticks with this command, then pause; the last state is published."""
    simulation.request(Pause()).result(LIMIT)
    for _ in range(3):
        simulation.request(Step(10, {"V1": command})).result(LIMIT)
    frame = simulation.request(Step(10, {"V1": command})).result(LIMIT)

    def stamp() -> float:
        """Of the wheels, which are published after all other states."""
        return seconds(node.last("wheels")["header"]["stamp"])

    wait_until(lambda: stamp() == pytest.approx(frame.time, abs=1e-9))
    return frame, frame.vehicles["V1"]


def seconds(stamp: Any) -> float:
    return stamp.sec + 1e-9 * stamp.nanosec


def vector(fields: dict[str, float]) -> list[float]:
    return [*fields.values()]


def tree(node: Recorder) -> Tree:
    return Tree(*(Message("", node.last(name)) for name in ("/tf_static", "/tf")))


# -- direct mode: published messages -------------------------------------------------------------------------------


def test_all_readings_equal_the_frame(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    frame, vehicle = after_drive(simulation, node, autodrive.Command(-0.7, 0.5, 2, 1))  # type: ignore[arg-type]
    assert node.last("throttle")["data"] == vehicle.throttle == -0.7
    assert node.last("steering")["data"] == vehicle.steering > 0.2
    assert node.last("speed")["data"] == -vehicle.speed > 0.01
    for i, side in enumerate(("left", "right")):
        message = node.last(f"{side}_encoder")
        assert message["position"] == pytest.approx([vehicle.encoders.angles[i]])
        assert message["name"] == [f"{side}_encoder"]
    assert vector(node.last("ips")) == pytest.approx(vehicle.ips.position)
    upward = matrix((0.0, 0.0, 0.0), np.roll(vehicle.imu.orientation, -1))[2, :3]
    for name, gravity in (("imu", 0.0), ("imu/data", 9.81), ("imu/data_raw", 9.81)):
        imu = node.last(name)
        if name != "imu/data_raw":
            assert vector(imu["orientation"]) == pytest.approx(np.roll(vehicle.imu.orientation, -1))
        assert vector(imu["angular_velocity"]) == pytest.approx(vehicle.imu.angular_velocity)
        acceleration = vehicle.imu.linear_acceleration + gravity * upward
        assert vector(imu["linear_acceleration"]) == pytest.approx(acceleration, abs=1e-9)
        assert seconds(imu["header"]["stamp"]) == pytest.approx(vehicle.imu.time)
    truth = node.last("ground_truth/odom")
    assert vector(truth["pose"]["pose"]["position"]) == pytest.approx(vehicle.pose.position)
    assert vector(truth["twist"]["twist"]["linear"]) == pytest.approx(vehicle.velocity)
    lights = node.last("lights")
    assert (lights["headlights"], lights["indicators"], lights["reverse_lights"]) == (2, 1, True)
    assert node.last("wheels")["normal_load"] == pytest.approx(vehicle.wheels.normal_load)
    assert seconds(node.last("/clock")["clock"]) == pytest.approx(frame.time)


def test_the_scan_equals_the_frame(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    _, vehicle = after_drive(simulation, node, autodrive.Command())
    assert vehicle.lidar is not None
    for name in ("lidar", "scan"):
        message = node.last(name)
        assert message["ranges"] == pytest.approx(vehicle.lidar.ranges.astype(np.float32))
        assert seconds(message["header"]["stamp"]) == pytest.approx(vehicle.lidar.time)
    assert len(node.messages["autodrive/nigel_1/scan"]) == len(node.messages["autodrive/nigel_1/lidar"])


def test_transforms_are_those_of_the_vehicle(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    _, vehicle = after_drive(simulation, node, autodrive.Command(0.9, -0.6))
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


def test_odometry_is_close_to_the_truth_after_a_short_drive(
    simulation: Simulation, bridge: Bridge, node: Recorder
) -> None:
    before = tree(node).pose("map", "base_link")
    _, vehicle = after_drive(simulation, node, autodrive.Command(0.8, 0.3))
    driven = np.linalg.norm(vehicle.pose.position - before[:3, 3])
    odom = node.last("odom")["pose"]["pose"]["position"]
    assert math.hypot(odom["x"], odom["y"]) == pytest.approx(driven, rel=0.25)


@pytest.mark.parametrize(
    ("profile", "root", "steering"),
    [("2020", "ego_vehicle", "steering_angle"), ("2022", "v1", "steering"), ("2023", "nigel_1", "steering")],
)
def test_names_and_signs_are_those_of_the_profile(
    simulation: Simulation, server: SimulationServer, node: Recorder, profile: str, root: str, steering: str
) -> None:
    devkit = PROFILES[profile]
    with running(Config(port=server.port, profile=profile, robot_description=URDF), node):
        wait_until(lambda: f"autodrive/{root}/lidar" in node.messages)
        simulation.request(Pause()).result(LIMIT)
        vehicle = simulation.request(Step(20, {"V1": autodrive.Command(0.0, 1.0)})).result(LIMIT).vehicles["V1"]
        topic = f"autodrive/{root}/{steering}"
        wait_until(lambda: node.last(topic)["data"] == devkit.feedback_sign * vehicle.steering)
        frames = tree(node)
        assert frames.pose("base_link", root)[:3, 3] == pytest.approx(devkit.origin)
        assert frames.pose("map", root)[:3, 3] == pytest.approx(vector(node.last(f"autodrive/{root}/ips")))
        begin = node.last(f"autodrive/{root}/lidar")["angle_min"]
        ahead = frames.pose("base_link", "lidar")[:3, :3] @ (math.cos(begin), math.sin(begin), 0.0)
        assert ahead == pytest.approx((1.0, 0.0, 0.0), abs=1e-6), "ray 0 points ahead"


# -- direct mode: commands and requests ----------------------------------------------------------------------------


def test_throttle_and_steering_drive_and_the_vehicle_stops_without_commands(
    simulation: Simulation, bridge: Bridge, node: Recorder
) -> None:
    def driven() -> bool:
        node.send("nigel_1/throttle_command", data=0.8)
        node.send("nigel_1/steering_command", data=1.0)
        now = simulation.frame.vehicles["V1"]
        return now.speed > 0.2 and now.steering > 0.4

    wait_until(driven)
    assert simulation.frame.vehicles["V1"].is_autonomous, "the command switches to autonomous mode"
    wait_until(lambda: abs(simulation.frame.vehicles["V1"].speed) < 0.001)


def test_lamps_are_commanded(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    node.send("nigel_1/headlights_command", data=1)
    node.send("nigel_1/indicators_command", data=3)
    wait_until(lambda: [*map(int, _lamps(simulation))] == [1, 3])


def _lamps(simulation: Simulation) -> tuple[int, int]:
    lights = simulation.frame.vehicles["V1"].lights
    return lights.headlights, lights.indicators


def send_pose(node: Recorder, frame: str, x: float, y: float, yaw: float, *, length: float = 1.0) -> None:
    """An initial pose in a TF frame; `length` of its quaternion."""
    spot = SimpleNamespace(x=x, y=y, z=0.0)
    turn = SimpleNamespace(x=0.0, y=0.0, z=length * math.sin(0.5 * yaw), w=length * math.cos(0.5 * yaw))
    pose = SimpleNamespace(pose=SimpleNamespace(position=spot, orientation=turn))
    node.send("nigel_1/initialpose", header=SimpleNamespace(frame_id=frame), pose=pose)


def test_an_initial_pose_teleports_the_vehicle(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    simulation.request(Pause()).result(LIMIT)
    send_pose(node, "map", 1.0, 0.1, 1.0)
    pose = simulation.frame.vehicles["V1"].pose
    assert pose.position[:2] == pytest.approx((1.0, 0.1), abs=1e-6)
    assert 2 * math.atan2(pose.orientation[3], pose.orientation[0]) == pytest.approx(1.0)


def marker(type_: int, **fields: Any) -> SimpleNamespace:
    """A visualization_msgs/Marker of ROS 2 with its defaults: zeros."""
    zero = {"x": 0.0, "y": 0.0, "z": 0.0}
    pose = SimpleNamespace(position=SimpleNamespace(**zero), orientation=SimpleNamespace(**zero, w=0.0))
    defaults: dict[str, Any] = {
        "header": SimpleNamespace(frame_id="map"),
        "ns": "plan",
        "id": 0,
        "action": 0,
        "pose": pose,
        "scale": SimpleNamespace(x=0.02, y=0.03, z=0.06),
        "color": SimpleNamespace(r=1.0, g=0.0, b=0.0, a=1.0),
        "colors": [],
        "lifetime": SimpleNamespace(sec=0, nanosec=0),
        "points": [],
        "text": "",
    }
    return SimpleNamespace(type=type_, **defaults | fields)


def test_markers_are_drawn_in_the_map_and_follow_the_frame_of_a_vehicle(
    simulation: Simulation, bridge: Bridge, node: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    simulation.request(Pause()).result(LIMIT)
    simulation.request(Teleport("V1", 1.0, 0.2, math.pi / 2)).result(LIMIT)
    wait_until(lambda: bridge.frame is not None and abs(bridge.frame.vehicles["V1"].pose.position[0] - 1.0) < 1e-6)
    corners = [SimpleNamespace(x=x, y=y, z=0.5) for x, y in ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))]
    half_turn = SimpleNamespace(x=0.0, y=0.0, z=1.0, w=0.0)
    turned = SimpleNamespace(position=SimpleNamespace(x=2.0, y=0.0, z=0.0), orientation=half_turn)
    ahead = SimpleNamespace(position=SimpleNamespace(x=0.3, y=0.0, z=0.0), orientation=half_turn)
    base_link, short = SimpleNamespace(frame_id="base_link"), SimpleNamespace(sec=1, nanosec=500_000_000)
    markers = [
        marker(4, points=corners, pose=turned),
        marker(2, id=1, header=base_link, pose=ahead, lifetime=short),
        marker(9, id=2, text="goal", pose=turned),
        marker(5, id=3, points=[]),
    ]
    node.send("markers", markers=markers)
    drawn = simulation.world.drawings
    assert sorted(drawn) == ["plan/0", "plan/1", "plan/2"]
    path, ball, goal = (drawn[f"plan/{i}"].drawing for i in range(3))
    assert path is not None
    assert ball is not None
    assert goal is not None
    assert (path.kind, path.size, path.lifetime) == ("path", 0.02, None)
    assert np.allclose(path.points, [(2, 0, 0.5), (1, 0, 0.5), (1, -1, 0.5)])  # half a turn about x = 2
    car = simulation.frame.vehicles["V1"].pose.position
    assert (ball.kind, ball.lifetime) == ("points", 1.5)
    assert np.allclose(ball.points, car + np.array((0.0, 0.3, 0.0)), atol=1e-3)  # it looks in the direction of y
    assert (goal.kind, goal.text, goal.size) == ("text", "goal", 0.06)
    node.send("markers", markers=[marker(0, action=2)])
    assert sorted(simulation.world.drawings) == ["plan/1", "plan/2"]
    node.send("markers", markers=[marker(0, action=3), marker(0, scale=SimpleNamespace(x=0.5, y=0.02, z=0.02))])
    (arrow,) = simulation.world.drawings.values()
    assert arrow.drawing is not None
    assert (arrow.drawing.points, arrow.drawing.size) == (((0.0, 0.0, 0.0), (0.5, 0.0, 0.0)), 0.02)
    node.send("markers", markers=[marker(10)])
    node.send("markers", markers=[marker(2, header=SimpleNamespace(frame_id="laser"))])
    assert "the marker 'plan/0' has the type 10; types 0 to 9 are drawn" in caplog.text
    assert "the frame 'laser' is not known. Known: map, nigel_1, left_encoder" in caplog.text
    assert list(simulation.world.drawings) == ["plan/0"]
    node.send("markers", markers=[marker(0, action=3)])
    simulation.request(Resume()).result(LIMIT)


def test_a_reset_restarts_the_odometry(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    after_drive(simulation, node, autodrive.Command(0.9))
    assert node.last("odom")["pose"]["pose"]["position"]["x"] > 0.01
    node.send("nigel_1/reset_command", data=True)
    wait_until(lambda: node.last("odom")["pose"]["pose"]["position"]["x"] == 0.0)


def test_a_refused_request_raises(bridge: Bridge) -> None:
    with pytest.raises(AutodriveError, match="aused"):
        bridge.request(Step(1))


def test_another_scenario_has_its_own_vehicles(simulation: Simulation, bridge: Bridge, node: Recorder) -> None:
    assert bridge.request(LoadScenario("two_cars"))

    def is_in_the_tree(frame: str) -> bool:
        with contextlib.suppress(KeyError):
            return tree(node).pose("map", frame).shape == (4, 4)
        return False

    wait_until(lambda: is_in_the_tree("nigel_2/lidar"))
    wait_until(lambda: "autodrive/nigel_2/odom" in node.messages)
    node.send("nigel_2/throttle_command", data=1.0)
    wait_until(lambda: simulation.frame.vehicles["V2"].throttle == 1.0)
    assert bridge.request(LoadScenario("mini_map"))
    wait_until(lambda: [*simulation.frame.vehicles] == ["V1"])


def test_a_restarted_simulator_is_found(simulation: Simulation, node: Recorder) -> None:
    port = free_port()
    with running(Config(port=port, robot_description=URDF), node):
        for _ in range(2):
            before = len(node.messages.get("/tf", []))
            with served(simulation, port):
                wait_until(lambda before=before: len(node.messages.get("/tf", [])) > before + 3)


def test_images_without_subscribers_are_not_requested(simulation: Simulation, server: SimulationServer) -> None:
    node = Recorder(unsubscribed="camera")
    with running(Config(port=server.port, robot_description=URDF), node) as bridge:
        wait_until(lambda: "/tf" in node.messages)
        assert not bridge.wants_images


def environment(node: Recorder, **values: float) -> None:
    """Publish on the topics of time of day and weather."""
    for name, value in values.items():
        node.subscriptions[f"autodrive/environment/{name}"].callback(SimpleNamespace(data=value))


def test_topics_set_the_weather_and_the_time_of_day(simulation: Simulation, server: SimulationServer) -> None:
    node = Recorder()
    with running(Config(port=server.port, robot_description=URDF), node) as bridge:
        wait_until(lambda: bridge.frame is not None)
        environment(node, weather_id=6, time_of_day=1140)
        weather = simulation.frame.weather
        assert weather is not None
        assert (weather.rain, simulation.frame.time_of_day) == (0.8, 19 * 3600.0)
        environment(node, weather_id=0, fog_intensity=7.0)  # limited to 1
        weather = simulation.frame.weather
        assert weather is not None
        assert (weather.rain, weather.fog) == (0.0, 1.0)
        environment(node, rain_intensity=math.nan, snow_intensity=0.5)  # not a number: refused, and the next one works
        weather = simulation.frame.weather
        assert weather is not None
        assert (weather.rain, weather.fog, weather.snow) == (0.0, 1.0, 0.5)
        environment(node, snow_intensity=0.0)
        environment(node, fog_intensity=0.0)
    simulation.request(Reset()).result(LIMIT)


def test_topics_of_traffic_lights_are_those_of_the_frame_and_set_them() -> None:
    with Simulation(started(autodrive.make("tiny_town"))) as simulation, served(simulation) as server:
        node = Recorder()
        with running(Config(port=server.port, robot_description=URDF), node):
            wait_until(lambda: "/autodrive/tl_4/state" in node.messages or "autodrive/tl_4/state" in node.messages)
            simulation.request(Pause()).result(LIMIT)
            frame = simulation.request(Step(1)).result(LIMIT)
            light = frame.traffic_lights["traffic_light_2"]
            wait_until(lambda: node.last("autodrive/tl_2/time_to_change")["data"] == light.time_to_change)
            assert node.last("autodrive/tl_2/state")["data"] == light.state

            def command(state: int) -> None:
                node.subscriptions["autodrive/tl_2/command"].callback(SimpleNamespace(data=state))

            command(3)
            set_ = simulation.request(Step(1)).result(LIMIT).traffic_lights["traffic_light_2"]
            assert (int(set_.state), set_.mode) == (3, "set")
            wait_until(lambda: math.isnan(node.last("autodrive/tl_2/time_to_change")["data"]))
            assert node.last("autodrive/tl_2/state")["data"] == 3
            command(0)
            assert simulation.request(Step(1)).result(LIMIT).traffic_lights["traffic_light_2"].mode == "program"


def test_what_a_vehicle_hears_by_radio_is_published() -> None:
    start = {"map": "crossing", "vehicles": {"V1": {"x": -1.5}, "V2": {"x": -2.5}}, "v2x": {"rate": 100.0}}
    world = autodrive.make(ScenarioSpec.model_validate(start))
    with Simulation(started(world)) as simulation, served(simulation) as server:
        node = Recorder()
        with running(Config(port=server.port, robot_description=URDF), node):
            wait_until(lambda: "autodrive/nigel_1/v2x/light/traffic_light_4" in node.messages)
            simulation.request(Pause()).result(LIMIT)
            reading = simulation.request(Step(1)).result(LIMIT).vehicles["V1"].v2x
            assert reading is not None
            car, light = reading.vehicles["V2"], reading.lights["traffic_light_4"]
            wait_until(lambda: node.last("v2x/vehicle/V2")["data"][0] == car.sent)
            wait_until(lambda: node.last("v2x/light/traffic_light_4")["data"][0] == light.sent)
            data = node.last("v2x/vehicle/V2")["data"]
            assert data.tolist() == [car.sent, *car.position, car.yaw, car.speed, car.steering, 0.0, 0.0, 2.0]
            data = node.last("v2x/light/traffic_light_4")["data"]
            assert data.tolist() == [light.sent, light.state, light.time_to_change]


# -- devkit mode ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("profile", ["2020", "2022", "2023", "2025"])
def test_devkit_messages_are_published_with_the_values_of_the_frame(simulation: Simulation, profile: str) -> None:
    node, port = Recorder(), free_port()
    root = f"autodrive/{Config(profile=profile).vehicle_name(1)}"
    simulation.request(SetDrivingMode("V1", True)).result(LIMIT)
    config = Config(mode="devkit", port=port, profile=profile, robot_description=URDF)
    with running(config, node), DevkitBridge(simulation, port=port, settings=DevkitSettings(profile=profile)):

        def driven() -> bool:
            for name, value in (("throttle", 0.8), ("steering", 0.5)):
                node.subscriptions[f"{root}/{name}_command"].callback(SimpleNamespace(data=value))
            vehicle = simulation.frame.vehicles["V1"]
            has_sensed = {f"{root}/lidar", f"{root}/front_camera"} <= node.messages.keys()
            return vehicle.speed > 0.2 and side * vehicle.steering > 0.2 and has_sensed

        side = PROFILES[profile].command_sign
        wait_until(driven)
        frame = simulation.request(Pause()).result(LIMIT)
        vehicle = frame.vehicles["V1"]
        ips, lever = f"{root}/ips", PROFILES[profile].origin
        expected = vehicle.pose.position + rotate(vehicle.pose.orientation, lever)
        truth = matrix(vehicle.pose.position, np.roll(vehicle.pose.orientation, -1))
        wait_until(lambda: ips in node.messages and vector(node.last(ips)) == pytest.approx(expected, abs=1e-3))
        wait_until(lambda: tree(node).pose("map", "base_link") == pytest.approx(truth, abs=2e-3))  # published later
        assert node.last(f"{root}/throttle")["data"] == pytest.approx(vehicle.throttle, abs=1e-3)
        assert node.last(f"{root}/imu")["angular_velocity"]["z"] == pytest.approx(
            vehicle.imu.angular_velocity[2], abs=2e-3
        )
        message = vehicle.lidar
        assert message is not None
        assert node.last(f"{root}/lidar")["ranges"] == pytest.approx(message.ranges, rel=1e-6)
        image = node.last(f"{root}/front_camera")
        assert len(image["data"]) == 3 * image["width"] * image["height"] > 0


def test_a_recorded_message_of_the_original_simulator_is_published_and_answered(node: Recorder) -> None:
    """It sends telemetry at once, without a handshake, and waits for an answer to each message."""
    recorded = json.loads((ROOT / "tests/protocol/data/devkit_2023.json").read_text(encoding="utf-8"))["telemetry"]
    port = free_port()
    with running(Config(mode="devkit", port=port, profile="2023", robot_description=URDF), node):
        wait_until(lambda: is_listening(port))
        url = f"ws://127.0.0.1:{port}/socket.io/?EIO=4&transport=websocket"
        with connect(url, compression=None, max_size=None) as original:
            for throttle in (0.0, 0.25):
                original.send("42" + json.dumps(["Bridge", recorded]))
                answer = next(text for text in original if str(text).startswith("42"))
                event, commands = json.loads(str(answer)[2:])
                assert float(commands["V1 Throttle"]) == throttle
                node.send("nigel_1/throttle_command", data=0.25)
                node.send("nigel_1/steering_command", data=-1.0)
    assert event == "Bridge"
    assert float(commands["V1 Steering"]) == -1.0
    assert {"V1 Headlights", "V1 Indicators", "TL1 State", "TL4 State"} <= commands.keys()
    assert vector(node.last("ips")) == pytest.approx((-1.1, 0.15, 0.033))
    assert node.last("lidar")["ranges"][:3] == pytest.approx([math.inf, 1.008726, 1.01745])
    assert node.last("lidar")["angle_min"] == pytest.approx(-math.pi)
    assert node.last("autodrive/signal_1/state")["data"] == 0


class Listening:
    """A listener that records updates and warnings."""

    wants_clock = wants_images = is_closed = False
    max_wait = 0.0

    def __init__(self) -> None:
        self.updates: list[Update] = []
        self.warnings: list[str] = []

    def on_vehicles(self, vehicles: dict[str, VehicleInfo]) -> None:
        pass

    def on_update(self, update: Update) -> None:
        self.updates.append(update)

    def on_idle(self) -> None:
        pass

    def warn(self, text: str) -> None:
        self.warnings.append(text)


def test_answers_are_delayed_to_the_configured_rate() -> None:
    now, listener = [10.0], Listening()

    def sleep(seconds: float) -> None:
        now[0] += seconds

    config = Config(mode="devkit", rate=50.0)
    source = DevkitSource(config, lambda: now[0], lambda: {"V1": Command()}, clock=lambda: now[0], sleep=sleep)
    times = []
    for _ in range(10):
        source.respond({"V1 Position": "0 0 0"}, listener)
        times.append(now[0])
    assert np.diff(times) == pytest.approx(1.0 / 50.0)
    now[0] += 5.0  # a late message is answered at once
    source.respond({"V1 Position": "0 0 0"}, listener)
    assert now[0] == pytest.approx(times[-1] + 5.0)


MALFORMED = [
    {"V1 Position": "here"},
    {"V1 Position": "0 0 0", "V1 Encoder Angles": "nan"},
    {"V1 Position": "0 0 0", "V1 Throttle": "full"},
    {"V1 Position": "0 0 0", "V1 LIDAR Range Array": "H4sI"},
    {"V1 Position": "0 0 0", "V1 Orientation Quaternion": "0 0 0 0", "TL1 State": "red"},
    {"V1 Position": "0 0 0", "V1 Front Camera Image": "%%%"},
    {"V1 Position": ["0"], "V1 Speed": {}},
]


@pytest.mark.parametrize("malformed", MALFORMED, ids=str)
def test_malformed_messages_are_answered_and_the_next_one_is_published(malformed: dict[str, Any]) -> None:
    listener = Listening()
    commands = {"V1": Command(0.25)}
    source = DevkitSource(Config(mode="devkit"), lambda: 1.0, lambda: commands, sleep=lambda _: None)
    for data in (malformed, {"V1 Position": "1 2 0.5", "V1 Throttle": "0.5"}):
        answer = source.respond(data, listener)
        assert answer is not None
        assert answer["V1 Throttle"] == "0.250"
    vehicle = listener.updates[-1].frame.vehicles["V1"]
    assert vehicle.ips.position.tolist() == [1.0, 2.0, 0.5]
    assert vehicle.throttle == 0.5


@pytest.mark.parametrize("car", CARS.values(), ids=list(CARS))
def test_figures_of_the_cars_are_those_of_their_files(car: Car) -> None:
    """`autodrive.connect.ros.cars` repeats them for installations without the simulator."""
    spec = load_vehicle(car.name)
    lidar = spec.sensors.lidar
    assert lidar is not None
    assert spec.wheelbase == car.wheelbase
    assert spec.wheels.radius == car.wheel_radius
    assert spec.full_throttle_speed == pytest.approx(car.speed_limit, abs=1e-3)
    assert spec.steering.limit == pytest.approx(car.steering_limit, abs=1e-5)
    assert tuple(spec.cameras) == car.cameras
    assert (lidar.range_min, lidar.range_max, lidar.rate) == (
        car.lidar_range_min,
        car.lidar_range_max,
        car.lidar_rate,
    )
    assert (lidar.rays, lidar.angle_min_deg) == (car.lidar_rays, car.lidar_angle_min)
    intervals = lidar.rays - lidar.rays % 2  # an odd number of rays has both ends of the field of view
    assert math.degrees(intervals * lidar.angle_increment) == pytest.approx(car.lidar_field_of_view)
    for camera in spec.cameras.values():
        lens = camera.intrinsics
        assert (lens.width, lens.height) == car.image_size
        assert (lens.fx, lens.fy) == pytest.approx((car.focal_length, car.focal_length), abs=5e-3)


GATE = 3.04 / 3.68
"""Focal length per width of the sensor, and so per width of the image: the published cameras fit horizontally."""


@pytest.mark.parametrize(
    ("vehicle_type", "size", "focal_lengths"),
    [
        ("", (1280, 720), (GATE * 1280, GATE * 1280)),  # of the simulator of 2023 to 2025
        ("nigel_2023", (1280, 720), (GATE * 1280, GATE * 1280)),
        ("", (640, 480), (240.0 / math.tan(math.radians(41.669 / 2)),) * 2),  # of the report of 2020
        ("nigel_2023", (640, 480), (240.0 / math.tan(math.radians(41.669 / 2)),) * 2),
        ("roboracer", (192, 108), (GATE * 192, GATE * 192)),
        ("roboracer", (96, 96), (GATE * 96, GATE * 192 * 96 / 108)),  # stretched, by --image-size
        ("roboracer", (640, 360), (180.0 / math.tan(math.radians(48.83 / 2)),) * 2),  # roboracer_physical
    ],
)
def test_in_devkit_mode_the_lens_is_that_of_the_published_car(
    vehicle_type: str, size: tuple[int, int], focal_lengths: tuple[float, float]
) -> None:
    listener = Listening()
    config = Config(mode="devkit", vehicle_type=vehicle_type)
    source = DevkitSource(config, lambda: 1.0, lambda: {"V1": Command()}, sleep=lambda _: None)
    source.respond({"V1 Position": "0 0 0", "V1 Front Camera Image": black_image(*size)}, listener)
    lens = listener.updates[-1].pictures["V1", "front"].intrinsics
    assert (lens.width, lens.height) == size
    assert (lens.fx, lens.fy) == pytest.approx(focal_lengths, abs=5e-3)


def test_in_devkit_mode_requests_raise() -> None:
    bridge = Bridge(Config(mode="devkit"), Recorder())
    with pytest.raises(AutodriveError, match="mode 'direct'"):
        bridge.request(Reset())


# -- invalid input -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("invalid", "message"),
    [
        ({"mode": "magic"}, "mode must be"),
        ({"profile": "1999"}, "profile must be"),
        ({"race": True}, "race needs the profile 'roboracer', not '2025'"),
        ({"port": 70000}, "port must be"),
        ({"rate": 0.0}, "rate must be"),
        ({"command_timeout": math.nan}, "command_timeout must be"),
        ({"picture_quality": 0}, "picture_quality must be"),
    ],
)
def test_invalid_configuration_raises(invalid: dict[str, Any], message: str) -> None:
    with pytest.raises(AutodriveError, match=message):
        Config(**invalid)


@pytest.mark.parametrize("text", ["", "<robot", "<robot><joint/></robot>", "no xml"])
def test_an_invalid_urdf_raises(text: str) -> None:
    if text:
        with pytest.raises(AutodriveError, match="not a valid URDF"):
            Bridge(Config(robot_description=text), Recorder())
    else:
        assert Bridge(Config(), Recorder()).frame is None
