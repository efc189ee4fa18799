"""The C++ package is built as its README says, and its examples drive the simulator."""

from __future__ import annotations

import base64
import contextlib
import gzip
import json
import time
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import autodrive
from autodrive import Command, Simulation
from autodrive.bridge.devkit import DevkitBridge
from autodrive.bridge.server import Server
from autodrive.devkit import Nigel
from autodrive.protocol.devkit import PROFILES, telemetry
from tests.bridge.conftest import PATIENCE
from tests.bridge.viewers import scenery
from tests.clients.conftest import program, run
from tests.protocol.devkit_frames import frame, scan, vehicle

URL = "ws://127.0.0.1:{}/socket.io/?EIO={}&transport=websocket"


def test_its_own_tests_pass(build: Path) -> None:
    run("ctest", "--test-dir", build, "--output-on-failure")


# -- the devkits' protocol ---------------------------------------------------------------------------------------


def bridge_event(data: object) -> str:
    return "42" + json.dumps(["Bridge", data])


TOLD = telemetry(frame(), PROFILES["2023"])


def commands(connection: ClientConnection) -> dict[str, str]:
    """Of the next answer."""
    while not (packet := str(connection.recv(PATIENCE))).startswith("42"):
        pass
    event, data = json.loads(packet[2:])
    assert event == "Bridge"
    return data


def test_a_client_of_engine_io_3_is_answered(build: Path) -> None:
    """As python-socketio 4: the server opens the namespace by itself, the client asks whether it lives."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 3)) as client:
        assert json.loads(str(client.recv(PATIENCE))[1:])["pingInterval"] == 25000
        assert client.recv(PATIENCE) == "40"
        client.send("2probe")
        assert client.recv(PATIENCE) == "3probe"
        client.send(bridge_event(TOLD))
        assert set(commands(client)) == {"V1 Throttle", "V1 Steering", "V1 Headlights"}


def test_a_client_of_engine_io_4_is_answered(build: Path) -> None:
    """As python-socketio 5: the client opens the namespace, and gets an acknowledgement where it wants one."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 4)) as client:
        assert json.loads(str(client.recv(PATIENCE))[1:])["maxPayload"] >= 1_000_000
        client.send("40")
        assert str(client.recv(PATIENCE)).startswith('40{"sid":')
        client.send("427" + bridge_event(TOLD)[2:])
        assert float(commands(client)["V1 Throttle"]) > 0.0
        assert client.recv(PATIENCE) == "437[]"


def test_a_client_that_greets_nobody_is_answered(build: Path) -> None:
    """As the original simulator: it claims 4, reads no greeting and speaks at once."""
    with program(build / "stop_before_box", 0) as (_, port), connect(URL.format(port, 4)) as client:
        client.send(bridge_event(TOLD))
        client.send("2")
        assert float(commands(client)["V1 Throttle"]) > 0.0
        assert client.recv(PATIENCE) == "3"


BAD = [
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
ODD = [
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
    {"V1 LIDAR Range Array": base64.b64encode(gzip.compress(bytes(50_000_000))).decode()},
    {"V1 LIDAR Range Array": "H4s" + "A" * 100},
    {"V1 LIDAR Range Array": "one two"},
    {"V1 LIDAR Range Array": 3},
    {"V1 Front Camera Image": "not base64!"},
    {"V1 Front Camera Image": "nullnull/null+nullAA=="},
    {"V1 Front Camera Image": "A"},
    {'\\"quoted\\"': "\\u0000\\n"},
    {"": ""},
]


def test_bad_messages_are_not_answered_and_odd_values_do_no_harm(build: Path) -> None:
    """The simulator may be of any year and anyone's; the sanitizers look on."""
    with program(build / "stop_before_box", 0) as (process, port):
        with connect(URL.format(port, 4), max_size=None) as client:
            for packet in BAD:
                client.send(packet)
            client.send(b"\x00\xff")
            client.send("2")  # what was said before is done with once this is answered
            answers: list[str] = []
            while (packet := str(client.recv(PATIENCE))) != "3":
                answers.append(packet)
            assert not [answer for answer in answers if answer.startswith("42")]
            for odd in ODD:
                client.send(bridge_event(TOLD | odd))
                assert float(commands(client)["V1 Throttle"]) > 0.0, odd
        with connect(URL.format(port, 4), max_size=None) as client, contextlib.suppress(ConnectionClosed, OSError):
            client.send("42" + 17_000_000 * " ")
            while client.recv(PATIENCE):  # more than 16 MB: it hangs up
                pass
            pytest.fail("it goes on listening")
        with connect(URL.format(port, 4)) as client:
            client.send(bridge_event(TOLD))
            assert commands(client)
        assert process.poll() is None


def test_who_speaks_http_is_told_what_this_is(build: Path) -> None:
    with program(build / "stop_before_box", 0) as (_, port):
        connection = HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
        connection.request("GET", "/socket.io/?EIO=4&transport=polling")
        answer = connection.getresponse()
        assert (answer.status, answer.read()[:25]) == (400, b"This is a driving script;")


def test_a_server_that_waits_costs_nothing(build: Path) -> None:
    with program(build / "stop_before_box", 0) as (process, port), connect(URL.format(port, 4)) as client:
        client.send(bridge_event(TOLD))
        commands(client)
        file = Path("/proc", str(process.pid), "schedstat")  # of its one thread [ns]
        before = int(file.read_text().split()[0])
        time.sleep(1.0)
        assert int(file.read_text().split()[0]) - before < 20e6


def test_a_vehicle_is_read_as_python_reads_it(build: Path) -> None:
    """Of each year that names its vehicles, escaped and not, and with numbers instead of texts."""
    picture = bytes(range(256)) * 3
    for year in ("2022", "2023", "2025"):
        told = frame(vehicle(lidar=scan([float("inf"), 1.0, 2.5] * 120, 0.0)))
        data = telemetry(told, PROFILES[year], images={("red", "front"): picture, ("red", "rear"): picture[1:]})
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
            said = run(build / "read_telemetry", given=message).splitlines()
            read = {name: [float(word) for word in words] for name, *words in map(str.split, said)}
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


def test_lock_step_in_cpp_gives_the_bits_of_world_step(build: Path) -> None:
    simulation = Simulation(autodrive.make("mini_map"))
    with simulation, Server(simulation, scenery=scenery, port=0) as server:
        said = run(build / "lockstep", server.port).split()
    world = autodrive.make("mini_map")
    told = world.frame
    while world.time < 2.0:
        told = world.step({"V1": Command(0.5, 0.2)})
    car = told.vehicles["V1"]
    assert car.lidar is not None
    assert int(said[0]) == told.tick
    np.testing.assert_array_equal([float(word) for word in said[1:4]], car.pose.position)
    assert (float(said[4]), float(said[5])) == (car.speed, car.lidar.ranges[0])
