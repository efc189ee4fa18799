"""The C++ interfaces: devkit server, telemetry and native client, tested with their examples."""

from __future__ import annotations

import base64
import contextlib
import gzip
import json
import math
import subprocess
import time
from collections.abc import Iterable
from http.client import HTTPConnection
from pathlib import Path
from threading import Thread
from typing import Any

import numpy as np
import pytest
from msgspec.structs import astuple, replace
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.sync.server import ServerConnection, serve
from websockets.typing import Subprotocol

import autodrive
from autodrive import Client, Command, Simulation
from autodrive.base.cache import user_name
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.client.last_run import NotedRun
from autodrive.connect.devkit import Nigel
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import encode
from autodrive.protocol.devkit import telemetry
from autodrive.protocol.devkit_profile import PROFILES
from autodrive.protocol.messages import Drawing, Event, Frame, Headlights, OffRoad, TrafficLightState
from autodrive.protocol.native import SUBPROTOCOL, Response, Welcome
from autodrive.scenario import ScenarioSpec
from autodrive.world import SensorView
from tests.clients.conftest import program
from tests.protocol.devkit_frames import frame, scan, vehicle
from tests.support.builds import run
from tests.support.cars import car_file
from tests.support.native_clients import scene_files, unpack
from tests.support.waiting import LIMIT

URL = "ws://127.0.0.1:{}/socket.io/?EIO={}&transport=websocket"


def test_text_functions_and_messages_agree_with_other_implementations(build: Path) -> None:
    run("ctest", "--test-dir", build, "--output-on-failure")


# -- devkit protocol ---------------------------------------------------------------------------------------


def bridge_event(data: object) -> str:
    return "42" + json.dumps(["Bridge", data])


TELEMETRY = telemetry(frame(), PROFILES["2023"])


def commands(connection: ClientConnection) -> dict[str, str]:
    """The next answer."""
    while not (packet := str(connection.recv(LIMIT))).startswith("42"):
        pass
    event, data = json.loads(packet[2:])
    assert event == "Bridge"
    return data


def test_a_client_of_engine_io_3_is_answered(build: Path) -> None:
    """Like python-socketio 4: the server opens the namespace, the client sends pings."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 3)) as client:
        assert json.loads(str(client.recv(LIMIT))[1:])["pingInterval"] == 25000
        assert client.recv(LIMIT) == "40"
        client.send("2probe")
        assert client.recv(LIMIT) == "3probe"
        client.send(bridge_event(TELEMETRY))
        assert set(commands(client)) == {"V1 Throttle", "V1 Steering", "V1 Steering Sign", "V1 Headlights"}


def test_a_client_of_engine_io_4_is_answered(build: Path) -> None:
    """Like python-socketio 5: the client opens the namespace and can ask for an acknowledgement."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 4)) as client:
        assert json.loads(str(client.recv(LIMIT))[1:])["maxPayload"] >= 1_000_000
        client.send("40")
        assert str(client.recv(LIMIT)).startswith('40{"sid":')
        client.send("427" + bridge_event(TELEMETRY)[2:])
        assert float(commands(client)["V1 Throttle"]) > 0.0
        assert client.recv(LIMIT) == "437[]"


def test_a_client_that_sends_no_handshake_is_answered(build: Path) -> None:
    """Like the original simulator: it announces version 4 and sends telemetry at once."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 4)) as client:
        client.send(bridge_event(TELEMETRY))
        client.send("2")
        assert float(commands(client)["V1 Throttle"]) > 0.0
        assert client.recv(LIMIT) == "3"


MALFORMED_MESSAGES = [
    "",
    "4",
    "42",
    "42[",
    '42["Bridge"]',
    '42["Bridge",[]]',
    '42["Bridge",{}]',
    '42["Bridge",{"V1 Throttle":"0.5"}',
    '42["Bridge",{"V1 Throttle" "0.5"}]',
    '42["Bridge",{"V1 Throttle":"0.5"}] and more',
    '42[42,{"V1 Throttle":"0.5"}]',
    '42["Other",{"V1 Throttle":"0.5"}]',
    "42" + 100_000 * "[",
    '42["Bridge",' + 10_000 * '{"a":' + "1" + 10_000 * "}" + "]",
    "9" * 1000,
    "40/other,",
    "41",
]
MALFORMED_VALUES = [
    {"V1 Throttle": "fast"},
    {"V1 Throttle": "0.5 0.5"},
    {"V1 Throttle": "1e999"},
    {"V1 Throttle": None},
    {"V1 Throttle": [1, 2]},
    {"V1 Throttle": True},
    {"V1 Position": "1 2"},
    {"V1 Position": {"x": 1}},
    {"V1 Orientation Quaternion": "0 0 0 0"},
    {"V1 LIDAR Range Array": "H4s"},
    {"V1 LIDAR Range Array": "H4sIAAAA"},
    {"V1 LIDAR Range Array": base64.b64encode(gzip.compress(bytes(50_000_000), 1)).decode()},
    {"V1 LIDAR Range Array": "H4s" + "A" * 100},
    {"V1 LIDAR Range Array": "one two"},
    {"V1 LIDAR Range Array": 3},
    {"V1 Front Camera Image": "not base64!"},
    {"V1 Front Camera Image": "nullnull/null+nullAA=="},
    {"V1 Front Camera Image": "A"},
    {'\\"quoted\\"': "\\u0000\\n"},
    {"": ""},
]


def test_malformed_messages_are_not_answered_and_malformed_values_are_ignored(build: Path) -> None:
    """The sanitizers report memory errors."""
    with program(build / "stop_before_box", 0) as (process, port):
        with connect(URL.format(port, 4), max_size=None) as client:
            for packet in MALFORMED_MESSAGES:
                client.send(packet)
            client.send(b"\x00\xff")
            client.send("2")  # all earlier messages were processed when this is answered
            answers: list[str] = []
            while (packet := str(client.recv(LIMIT))) != "3":
                answers.append(packet)
            assert not [answer for answer in answers if answer.startswith("42")]
            for value in MALFORMED_VALUES:
                client.send(bridge_event(TELEMETRY | value))
                assert float(commands(client)["V1 Throttle"]) > 0.0, value
        with connect(URL.format(port, 4), max_size=None) as client, contextlib.suppress(ConnectionClosed, OSError):
            client.send("42" + 17_000_000 * " ")
            while client.recv(LIMIT):  # a message above 16 MB closes the connection
                pass
            pytest.fail("the connection stays open")
        with connect(URL.format(port, 4)) as client:
            client.send(bridge_event(TELEMETRY))
            assert commands(client)
        assert process.poll() is None


def test_an_http_request_is_answered_with_an_explanation(build: Path) -> None:
    with program(build / "stop_before_box", 0) as (_, port):
        connection = HTTPConnection("127.0.0.1", port, timeout=LIMIT)
        connection.request("GET", "/socket.io/?EIO=4&transport=polling")
        answer = connection.getresponse()
        assert (answer.status, answer.read()[:25]) == (400, b"This is a driving script;")


@pytest.mark.wall_clock  # CPU time of the waiting thread is measured over one second
def test_a_waiting_server_uses_no_cpu(build: Path) -> None:
    with program(build / "stop_before_box", 0) as (process, port), connect(URL.format(port, 4)) as client:
        client.send(bridge_event(TELEMETRY))
        commands(client)
        file = Path("/proc", str(process.pid), "schedstat")  # CPU time of its only thread [ns]
        before = int(file.read_text().split()[0])
        time.sleep(1.0)
        assert int(file.read_text().split()[0]) - before < 20e6


def test_cpp_and_python_read_the_same_state(build: Path) -> None:
    """Messages of each prefixed profile: plain, with spaces, with escapes, and with numbers instead of texts."""
    picture = bytes(range(256)) * 3
    for year in ("2022", "2023", "2025"):
        sent = frame(vehicle(lidar=scan([float("inf"), 1.0, 2.5] * 120, 0.0)))
        data = telemetry(sent, PROFILES[year], images={("red", "front"): picture, ("red", "rear"): picture[1:]})
        nigel = Nigel("V1")
        nigel.parse_data(data)
        wanted = {
            **{name: np.atleast_1d(getattr(nigel, name)).tolist() for name in ("throttle", "steering", "position")},
            **{name: getattr(nigel, name).tolist() for name in ("encoder_ticks", "encoder_angles")},
            **{name: getattr(nigel, name).tolist() for name in ("angular_velocity", "linear_acceleration")},
            "speed": [float("nan") if nigel.speed is None else nigel.speed],
            "orientation": list(nigel.orientation_quaternion),  # pyright: ignore
            "euler_angles": list(nigel.orientation_euler_angles),  # pyright: ignore
            "lidar_scan_rate": [nigel.lidar_scan_rate],
            "lidar_ranges": list(nigel.lidar_range_array),  # pyright: ignore
            "lidar_intensities": list(nigel.lidar_intensity_array),  # pyright: ignore
            "front_camera_jpeg": list(picture),
            "rear_camera_jpeg": list(picture[1:]),
        }
        plain = json.dumps(["Bridge", data])
        spaced = json.dumps(["Bridge", data], indent=1)
        escaped = json.dumps(["Bridge", data | {"else": "\\\\"}])
        number = json.dumps(["Bridge", data | {"V1 Throttle": nigel.throttle}])
        for message in (plain, spaced, escaped, number):
            lines = run(build / "tests", "telemetry", stdin=message).splitlines()
            read = {name: [float(word) for word in words] for name, *words in map(str.split, lines)}
            assert set(read) == set(wanted)
            for name, values in wanted.items():
                np.testing.assert_array_equal(read[name], values, err_msg=name)


# -- against the simulator ---------------------------------------------------------------------------------------


def test_the_devkit_example_stops_before_the_box(build: Path) -> None:
    simulation = Simulation(autodrive.make("boxes"))
    with (
        program(build / "stop_before_box", 0) as (_, port),
        DevkitBridge(simulation, port=port) as bridge,
    ):
        simulation.run(6.0)
        assert bridge.counters.refused_values == 0
        assert bridge.counters.commands_received > 100
    car = simulation.frame.vehicles["V1"]
    assert abs(car.speed) < 1e-3
    assert 0.3 < car.pose.position[0] < 0.5
    assert car.lights.headlights == 1
    assert car.collision_count == 0


def test_lock_step_in_cpp_equals_world_step(build: Path) -> None:
    simulation = Simulation(autodrive.make("mini_map"))
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        printed = run(build / "lockstep", server.port).split()
    world = autodrive.make("mini_map")
    frame_ = world.frame
    while world.time < 2.0:
        frame_ = world.step({"V1": Command(0.5, 0.2)})
    car = frame_.vehicles["V1"]
    assert car.lidar is not None
    assert int(printed[0]) == frame_.tick
    np.testing.assert_array_equal([float(word) for word in printed[1:4]], car.pose.position)
    assert (float(printed[4]), float(printed[5])) == (car.speed, car.lidar.ranges[0])


def test_cpp_sets_a_traffic_light_and_reads_what_a_vehicle_hears(build: Path) -> None:
    scenario = ScenarioSpec.model_validate(
        {
            "map": "crossing",
            "vehicles": {"V1": {"x": -1.5}, "V2": {"x": -2.5}},
            "v2x": {"rate": 100.0},
            "traffic": {"cars": 2},
        }
    )
    simulation = Simulation(autodrive.make(scenario))
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        light, traffic, *heard = run(build / "traffic", server.port).splitlines()
    assert light == "2 set"
    assert traffic.split() == ["traffic_1", "traffic_2"]
    world = autodrive.make(scenario)
    world.set_traffic_light("traffic_light_3", TrafficLightState.YELLOW)
    reading = world.step().vehicles["V1"].v2x
    assert reading is not None
    assert len(reading.vehicles) == 3
    cars = {
        name: (
            *(one.sent, one.received, *one.position, one.yaw, one.speed, one.steering),
            *(one.lights.headlights, one.lights.indicators),
        )
        for name, one in reading.vehicles.items()
    }
    lights = {name: (one.sent, one.state, one.time_to_change or -1.0) for name, one in reading.lights.items()}
    assert {name: tuple(map(float, words)) for name, *words in map(str.split, heard)} == {**cars, **lights}


def test_cpp_draws_into_the_view(build: Path) -> None:
    simulation = Simulation(autodrive.make("plane"))
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        refused = run(build / "draw", server.port)
        drawn = {name: one.drawing for name, one in simulation.world.drawings.items()}
    assert drawn == {
        "plan": Drawing("path", ((0.0, 0.0, 0.01), (1.0, 0.5, 0.01), (2.0, 0.0, 0.25))),
        "goal": Drawing("text", ((1.0, 2.0, 0.5),), "goal", (0.0, 1.0, 0.0, 0.5), 0.06, 2.0),
    }
    assert "drawing 'wrong', a path, needs 2 to 2000 points, not 1" in refused


def test_cpp_sets_and_reads_weather_and_time_of_day(build: Path) -> None:
    simulation = Simulation(autodrive.make("plane"))
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        first, later, refused, last = run(build / "weather", server.port).splitlines()
    # clouds, fog, rain, snow, wind, wetness, snow cover, seconds since midnight
    assert [float(word) for word in first.split()] == [0.0, 0.0, 0.6, 0.0, 0.25, 0.0, 0.5, 66600.0]
    wetness = 1.0 - math.exp(-1.0)  # after 20 s, the time constant
    # the ground is followed every 0.1 s, in which wetness changes by at most 0.1 / 20
    assert [float(word) for word in later.split()] == pytest.approx(
        [0.0, 0.0, 0.6, 0.0, 0.25, wetness, 0.5, 66600.0], abs=0.005
    )
    assert "<= 1.0" in refused
    assert "weather.fog" in refused
    assert last == "clear"


def test_cpp_without_an_address_uses_the_last_run_in_its_folder(
    build: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.delenv("AUTODRIVE_PORT", raising=False)
    monkeypatch.chdir(tmp_path)

    def printed(*words: object) -> list[str]:
        line = [str(build / "default_address"), *map(str, words)]
        done = subprocess.run(line, capture_output=True, text=True, timeout=LIMIT, check=True)
        return [*done.stderr.splitlines(), *done.stdout.splitlines()]

    simulation = Simulation(autodrive.make("plane"))
    title = simulation.world.spec.title
    server = SimulationServer(Served(simulation, scene_files), PageOptions(host="::1", port=0))
    note = NotedRun(server.origin)
    (tmp_path / "autodrive" / "runs").mkdir(parents=True, mode=0o700)
    (tmp_path / "autodrive" / "runs" / "0.json").write_text("no note")
    with simulation, note:
        assert printed() == ["the simulator in this folder does not listen yet"]
        with server:
            note.write(server.address)
            told, shown = printed()
            assert shown == title
            assert told.startswith(
                f"autodrive: connected to '{title}' at [::1]:{server.port}, started by {user_name()} at 2"
            )
            assert printed("::1", server.port) == [title]
            monkeypatch.setenv("AUTODRIVE_PORT", str(server.port))
            assert printed()[-1] == title
            monkeypatch.setenv("AUTODRIVE_PORT", "1")
            assert "AUTODRIVE_PORT is 1, but the last run in this folder is at [::1]" in printed()[0]
            monkeypatch.setenv("AUTODRIVE_PORT", "x")
            assert printed() == ["AUTODRIVE_PORT must be a port, 1 to 65535, not 'x'"]
            monkeypatch.delenv("AUTODRIVE_PORT")
            with NotedRun(replace(server.origin, id="other", started=server.origin.started + 1.0)) as other:
                other.write(server.address)
                assert "is not the last run in this folder: give the address" in printed()[0]


class Beam:
    """A sensor of the user: the distance ahead, and a random number."""

    rate = 50.0
    columns = ("distance [m]", "noise")

    def sample(self, view: SensorView, random: np.random.Generator) -> tuple[float, float]:
        (distance,) = view.cast((0.3, 0.0, 0.1), (1.0, 0.0, 0.0))
        return distance, random.normal()


def event_words(event: Event) -> list[object]:
    """What the program prints of an event: the fields of all events, then its own."""
    own = [field for field in event.__struct_fields__ if field not in ("time", "vehicle", "position")]
    values = [getattr(event, field) for field in own]
    return [type(event).__name__, event.time, event.vehicle, *getattr(event, "position", (0.0, 0.0, 0.0)), *values]


def as_printed(values: Iterable[Any]) -> list[object]:
    return [word for value in values for word in (value.split() if isinstance(value, str) else [value])]


def test_cpp_reads_the_same_frames_and_events_as_the_python_client(build: Path, tmp_path: Path) -> None:
    sensor = {"mount": {"position": [0.2, 0.0, 0.08]}, "field_of_view_deg": 15, "range_max": 4.0, "rate": 20}
    scenario = {
        "map": "practice",
        "vehicles": {"V1": {"type": car_file(tmp_path, {"sensors.range": sensor}, "roboracer")}, "V2": {}},
        "boxes": {"box": {"x": -14.0, "y": -3.0}},
        "race": {"rules": "league_2026"},
        "v2x": {"rate": 100.0},
        "weather": {"rain": 0.5, "fog": 0.2},
    }
    steps = 40
    world = autodrive.make(ScenarioSpec.model_validate(scenario))
    world.add_sensor("V1", "beam", Beam())
    simulation = Simulation(world)
    with simulation, SimulationServer(Served(simulation, scene_files), PageOptions(port=0)) as server:
        lines = run(build / "frame", server.port, steps).splitlines()
        with Client(server.address) as client:
            client.pause()
            frame = client.reset()
            events: list[Event] = []
            for _ in range(steps):
                drive = {"V1": Command(0.3, headlights=Headlights.HIGH), "V2": Command(0.5)}
                frame = client.step(drive, ticks=20)
                events += frame.events
    car = frame.vehicles["V1"]
    ips, lights, wheels, race, heard = car.ips, car.lights, car.wheels, car.race, car.v2x
    assert car.range
    assert race
    assert heard
    assert frame.weather
    assert frame.weather_effects
    neighbour = heard.vehicles["V2"]
    wanted: list[list[object]] = [
        *(event_words(event) for event in events),
        ["tick", frame.tick],
        ["pose", *car.pose.position],
        ["orientation", *car.pose.orientation],
        ["speed", car.speed],
        ["ticks", *car.encoders.ticks],
        ["angles", *car.encoders.angles],
        ["ips", ips.time, *ips.position],
        ["acceleration", *car.imu.linear_acceleration],
        ["lights", *astuple(lights)],
        *([name, *getattr(wheels, name)] for name in ("steering_angle", "rotation_angle")),
        ["wheel_velocity", *wheels.angular_velocity],
        *([name, *getattr(wheels, name)] for name in ("compression", "normal_load", "slip_ratio", "slip_angle")),
        ["range", *astuple(car.range)[:-1]],
        ["radiation", car.range.radiation],
        ["race", *(getattr(race, name) for name in ("lap_time", "last_lap_time", "best_lap_time", "race_time"))],
        ["more_race", race.penalty, race.distance, race.gap, race.is_wrong_way],
        ["counts", race.status, race.lap_count, race.lap_total, race.collision_count, race.checkpoint, race.rank],
        ["own", *car.own["beam"].values],
        ["columns", *car.own["beam"].columns],
        ["heard", neighbour.sent, neighbour.received, neighbour.yaw, neighbour.speed, neighbour.steering],
        ["heard_position", *neighbour.position],
        ["weather", *astuple(frame.weather)],
        ["effects", *astuple(frame.weather_effects)],
        ["box", *frame.objects["box"].pose.position],
    ]
    assert {"Collision", "SetBack", "CheckpointPassed"} <= {row[0] for row in wanted}
    read = [line.split() for line in lines]
    assert len(read) == len(wanted)
    for words, values in zip(read, map(as_printed, wanted), strict=True):
        assert [word if isinstance(value, str) else float(word) for word, value in zip(words, values, strict=True)] == [
            value if isinstance(value, str) else float(value)  # type: ignore[arg-type]  # pyright: ignore[reportArgumentType]
            for value in values
        ]


def test_cpp_keeps_the_events_of_frames_that_it_did_not_return(build: Path) -> None:
    """The Response to a request comes after two streamed Frames; another Frame comes later."""
    world = autodrive.make("plane")

    def frame_of(tick: int) -> Frame:
        return replace(world.frame, tick=tick, events=(OffRoad(0.0, f"car_{tick}", np.zeros(3)),))

    def answer(connection: ServerConnection) -> None:
        for _ in ("Hello", "Subscribe"):
            connection.recv(LIMIT)
        for message in (Welcome(2, "", "", {}), scene_files(world).scene):
            connection.send(encode(message))
        request = unpack(connection.recv(LIMIT))
        for message in (frame_of(1), frame_of(2), Response(request["id"], frame_of(3)), frame_of(4)):
            connection.send(encode(message))
        with contextlib.suppress(ConnectionClosed):
            connection.recv(LIMIT)

    with serve(answer, "127.0.0.1", 0, subprotocols=[Subprotocol(SUBPROTOCOL)]) as server:
        thread = Thread(target=server.serve_forever)
        thread.start()
        try:
            printed = run(build / "tests", "events", server.socket.getsockname()[1])
        finally:
            server.shutdown()
            thread.join()
    assert printed.splitlines() == ["car_1 car_2 car_3 3", "car_4 4"]
