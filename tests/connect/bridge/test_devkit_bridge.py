"""The devkit bridge on a running simulation against valid and faulty servers, over real sockets."""

from __future__ import annotations

import base64
import contextlib
import itertools
import json
import re
import socket
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection

import autodrive
from autodrive import AutodriveError, Frame, Simulation
from autodrive.connect.bridge.devkit import DevkitBridge
from autodrive.connect.bridge.engineio import Dialect
from autodrive.connect.devkit import Server
from autodrive.protocol.devkit import black_image
from autodrive.protocol.devkit_profile import DevkitSettings, Side
from autodrive.protocol.messages import (
    CameraImage,
    CameraIntrinsics,
    Command,
    Operation,
    Pause,
    Reset,
    Resume,
    SetDrivingMode,
    SetSceneLight,
    Step,
)
from autodrive.run.race_seat import Seat
from autodrive.scenario.race_rules import load_rules
from autodrive.world import World
from autodrive.world.simulation.control import Control, Publisher
from tests.connect.bridge.conftest import Resets, peer
from tests.support.waiting import LIMIT, free_port, wait_until

FULL_THROTTLE = {"V1 Throttle": "1.000000", "V1 Steering": "0.000000", "V1 Headlights": "1", "V1 Indicators": "0"}
"""As the C++ devkit writes numbers."""
HANDSHAKE = '0{"sid":"x","upgrades":[],"pingTimeout":20000,"pingInterval":25000,"maxPayload":1000000}'


def bridge_messages(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What the bridge logged: on a busy machine the simulation logs that it is late, too."""
    return [record.getMessage() for record in caplog.records if record.name.startswith("autodrive.connect.bridge")]


def packet(commands: Mapping[str, object]) -> str:
    return "42" + json.dumps(["Bridge", commands])


def telemetry_in(connection: ServerConnection) -> Iterator[dict[str, str]]:
    """Telemetry of the client, parsed as strictly as by the C++ devkit; other packets are skipped."""
    with contextlib.suppress(ConnectionClosed):
        for text in connection:
            if str(text).startswith("42"):
                yield checked(str(text))


def checked(text: str) -> dict[str, str]:
    assert text.endswith("}]")
    assert len(text) < 1_000_000
    assert "null" not in text
    name, data = json.loads(text[2:])
    assert name == "Bridge"
    assert all(isinstance(value, str) for value in data.values())
    return data


@dataclass
class Script:
    """Like the C++ devkit: sends nothing on connect and answers each telemetry message: no handshake, no pings.

    The answers are `commands`, or those of the number of messages received.
    """

    commands: Mapping[str, object] | Callable[[int], Mapping[str, object]] = field(default_factory=FULL_THROTTLE.copy)
    received: list[dict[str, str]] = field(default_factory=list)

    def __call__(self, connection: ServerConnection) -> None:
        for data in telemetry_in(connection):
            self.received.append(data)
            commands = self.commands if isinstance(self.commands, Mapping) else self.commands(len(self.received))
            connection.send(packet(commands))


@contextlib.contextmanager
def bridged(
    simulation: Control, talk: Callable[[ServerConnection], None] | None = None, **options: Any
) -> Iterator[DevkitBridge]:
    """A bridge that is connected to a server with that conversation; None: a Script with full throttle."""
    with peer(talk or Script()) as port, DevkitBridge(simulation, port=port, **options) as bridge:
        yield bridge


def test_the_raw_dialect_drives_the_car(simulation: Simulation) -> None:
    with bridged(simulation) as bridge:
        wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert bridge.status == "connected"
        assert bridge.counters.dialect is Dialect.RAW
        assert bridge.counters.profile == "2023"
        assert bridge.counters.resends == bridge.counters.bad_packets == 0
    assert bridge.status == "closed"


class Slow:
    """A script that answers the first message, and the next ones only while `go_on` is set; `hang_up` ends it."""

    def __init__(self) -> None:
        self.go_on, self.hang_up = threading.Event(), threading.Event()
        self.answers = 0

    def __call__(self, connection: ServerConnection) -> None:
        for _ in telemetry_in(connection):  # it is sent again while it is not answered
            if self.hang_up.is_set():
                return
            if self.answers == 0 or self.go_on.is_set():
                self.answers += 1
                connection.send(packet(FULL_THROTTLE))


def throttle_after(simulation: Simulation, ticks: int) -> float:
    """Throttle that V1 obeys after so many more ticks."""
    end = simulation.ticks + ticks
    wait_until(lambda: simulation.ticks >= end)
    return simulation.frame.vehicles["V1"].throttle


TIMEOUT = 60
"""More ticks than a command of a client is valid: 0.5 s."""


@pytest.mark.parametrize("is_race", [False, True])
def test_the_last_command_of_a_slow_script_is_valid_until_the_connection_ends(
    simulation: Simulation, is_race: bool
) -> None:
    script = Slow()
    control: Control = simulation
    if is_race:
        control = Seat(simulation, "V1", load_rules("practice"))
        simulation.add_sink(control)
    with bridged(control, script, resend_delay=0.02) as bridge:
        wait_until(lambda: bridge.counters.commands_received)
        assert throttle_after(simulation, TIMEOUT) == 1.0
        assert bridge.counters.commands_received == 1
        simulation.submit("V1", Command(0.5, 0.1))  # of another script, which has a time limit
        wait_until(lambda: simulation.frame.vehicles["V1"].throttle == 0.5)
        assert throttle_after(simulation, TIMEOUT) == 0.0
        script.go_on.set()
        wait_until(lambda: simulation.frame.vehicles["V1"].throttle == 1.0)
        script.go_on.clear()
        assert throttle_after(simulation, TIMEOUT) == 1.0
        script.hang_up.set()
        wait_until(lambda: bridge.status != "connected")
        assert throttle_after(simulation, TIMEOUT) == 0.0


@pytest.mark.parametrize(
    "operations",
    [
        [Reset()],
        [SetDrivingMode("V1", False), SetDrivingMode("V1", True)],
        [Pause(), Step(1, {"V1": Command(0.1)}), Resume()],
    ],
)
def test_an_operation_of_the_user_ends_the_last_command_of_a_slow_script(
    simulation: Simulation, operations: list[Operation]
) -> None:
    with bridged(simulation, Slow(), resend_delay=0.02) as bridge:
        wait_until(lambda: bridge.counters.commands_received)
        assert throttle_after(simulation, 5) == 1.0
        simulation.request(SetSceneLight(False)).result()  # changes nothing about it
        assert throttle_after(simulation, TIMEOUT) == 1.0
        for operation in operations:
            simulation.request(operation).result()
        simulation.request(SetDrivingMode("V1", True)).result()
        assert throttle_after(simulation, TIMEOUT) == 0.0


@contextlib.contextmanager
def engine_io_4(talk: Callable[[ServerConnection, dict[str, str]], None]) -> Iterator[int]:
    """A server of python-socketio 5 that calls `talk` with each telemetry message; its port."""

    def serve(connection: ServerConnection) -> None:
        connection.send(HANDSHAKE)
        connection.send('40{"sid":"y"}')
        for text in connection:
            if event := re.fullmatch(r"42\d*(\[.*)", str(text), re.DOTALL):
                talk(connection, json.loads(event[1])[1])

    with peer(serve) as port:
        yield port


@pytest.mark.parametrize(
    ("settings", "patience", "formats"),
    [
        (DevkitSettings(), 0.0, ["", "inf ", "H4sI"]),  # scripts of all years read an empty scan
        (DevkitSettings(profile="2025"), 0.0, ["H4sI", "inf ", "H4sI"]),
        (DevkitSettings(profile="2025", lidar="text"), 0.0, ["inf "] * 3),
        (DevkitSettings(), 10 * LIMIT, [""] * 3),  # a slow first answer does not change the format
    ],
)
def test_a_script_that_does_not_answer_gets_the_scan_in_another_format(
    simulation: Simulation,
    settings: DevkitSettings,
    patience: float,
    formats: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("autodrive.connect.bridge.flow_control.PATIENCE", patience)
    received: list[str] = []
    with (
        engine_io_4(lambda _, data: received.append(data["V1 LIDAR Range Array"][:4])) as port,
        DevkitBridge(simulation, port=port, settings=settings, resend_delay=0.02),
    ):
        wait_until(lambda: len(received) >= 3)
    assert received[:3] == formats


OLD, NEW = {"V1 Throttle": "0", "V1 Headlights": "0"}, {"V1 Throttle": "0", "V1 Reset": "False"}


@pytest.mark.parametrize(
    ("settings", "commands", "expected"),
    [
        (DevkitSettings(), OLD, "inf "),
        (DevkitSettings(), NEW, "H4sI"),
        (DevkitSettings(profile="2025"), OLD, "inf "),
        (DevkitSettings(profile="2023"), NEW, "H4sI"),
        (DevkitSettings(profile="2025", lidar="gzip"), OLD, "H4sI"),
        (DevkitSettings(lidar="text"), NEW, "inf "),
    ],
)
def test_scans_have_the_format_that_the_commands_imply(
    simulation: Simulation, settings: DevkitSettings, commands: dict[str, str], expected: str
) -> None:
    received: list[str] = []

    def answer(connection: ServerConnection, data: dict[str, str]) -> None:
        received.append(data["V1 LIDAR Range Array"][:4])
        connection.send(packet(commands))

    with (
        engine_io_4(answer) as port,
        DevkitBridge(simulation, port=port, settings=settings, resend_delay=0.05) as bridge,
    ):
        wait_until(lambda: len(received) > 5)
        devkit = bridge.counters.devkit
    assert "" not in received[3:]  # on a loaded machine, the state is sent again before the first answer is read
    assert received[-1] == expected
    assert f"LIDAR as {'text' if expected == 'inf ' else 'gzip'}" in devkit


def raw(talk: Callable[[ServerConnection, dict[str, str]], None]) -> contextlib.AbstractContextManager[int]:
    """A server like the C++ devkit that calls `talk` with each telemetry message; its port."""

    def serve(connection: ServerConnection) -> None:
        for data in telemetry_in(connection):
            talk(connection, data)

    return peer(serve)


@pytest.mark.parametrize(
    ("server", "vehicles", "formats"),
    [
        (raw, "roboracer", ["H4sI", "inf ", "H4sI"]),
        (raw, None, ["inf ", "H4sI", "inf "]),
        (engine_io_4, "roboracer", ["H4sI", "inf ", "H4sI"]),
    ],
)
def test_the_format_of_the_vehicles_comes_first_and_then_the_other_one(
    simulation: Simulation,
    server: Callable[..., contextlib.AbstractContextManager[int]],
    vehicles: str | None,
    formats: list[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("autodrive.connect.bridge.flow_control.PATIENCE", 0.0)
    received: list[str] = []
    with (
        server(lambda _, data: received.append(data["V1 LIDAR Range Array"][:4])) as port,
        DevkitBridge(simulation, port=port, vehicle_profile=lambda: vehicles, resend_delay=0.02),
    ):
        wait_until(lambda: len(received) >= 3)
    assert received[:3] == formats


@pytest.mark.parametrize(
    ("server", "readable", "commands", "expected"),
    [
        (engine_io_4, "H4sI", OLD, "H4sI"),  # a script of the league may command throttle and steering only
        (engine_io_4, "inf ", OLD, "inf "),  # raises on gzip
        (raw, "", OLD, "inf "),  # C++ of 2023 answers to gzip, but reads no number of it
        (raw, "H4sI", NEW, "H4sI"),
    ],
)
def test_scripts_for_vehicles_with_a_profile_get_the_format_that_they_read(
    simulation: Simulation,
    server: Callable[..., contextlib.AbstractContextManager[int]],
    readable: str,
    commands: dict[str, str],
    expected: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("autodrive.connect.bridge.flow_control.PATIENCE", 0.0)
    received: list[str] = []

    def answer(connection: ServerConnection, data: dict[str, str]) -> None:
        received.append(data["V1 LIDAR Range Array"][:4])
        if received[-1].startswith(readable):
            connection.send(packet(commands))

    with (
        server(answer) as port,
        DevkitBridge(simulation, port=port, vehicle_profile=lambda: "roboracer", resend_delay=0.5) as bridge,
    ):
        wait_until(lambda: bridge.counters.commands_received > 30)
    assert set(received[-10:]) == {expected}


def test_the_first_message_has_a_scan_and_its_rate_also_after_a_reset(simulation: Simulation) -> None:
    simulation.request(Pause()).result(LIMIT)
    simulation.request(Reset()).result(LIMIT)
    with bridged(simulation, script := Script(OLD)):
        wait_until(lambda: script.received)
        simulation.request(Reset()).result(LIMIT)
        wait_until(lambda: len(script.received) > 2)
    for data in script.received:
        assert float(data["V1 LIDAR Scan Rate"]) == 7.0
        assert len(data["V1 LIDAR Range Array"].split()) == len(data["V1 LIDAR Intensity Array"].split()) == 360


def test_a_server_that_never_clears_its_buffer_reads_every_message(simulation: Simulation) -> None:
    """Like the published C++ devkit: the text of a message ends at the last `}]` of what its buffer contains."""
    buffer = bytearray(2**21)
    sizes: list[int] = []

    def unclean(connection: ServerConnection) -> None:
        for text in connection:
            message = str(text).encode()
            buffer[: len(message)] = message
            if message.startswith(b"42"):
                end = buffer.rfind(b"}]") + 2
                json.loads(buffer[2:end])
                sizes.append(len(message))
                connection.send(packet(FULL_THROTTLE))

    noise = np.random.default_rng(1)

    cameras = [("V1", "front"), ("V1", "rear")]

    def images(frame: Frame, _: float) -> dict[tuple[str, str], bytes]:
        return {key: b"\xff\xd8" + noise.bytes(1000 + frame.tick * 7919 % 30000) for key in cameras}

    with bridged(simulation, unclean, images=images, image_sizes=lambda: dict.fromkeys(cameras, (640, 480))) as bridge:
        wait_until(lambda: len(sizes) > 20)
        assert bridge.counters.connections == 1
    assert len(set(sizes)) == 1
    assert sizes[0] > 4 / 3 * 2 * 31000  # room for two images, which the first one may not fill


def test_no_frame_mask_contains_the_end_of_a_message(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    """uWebSockets 0.14 leaves the mask behind the text of a frame, and the published C++ devkit reads it."""
    masks: list[bytes] = []

    def token_bytes(count: int) -> bytes:
        if count != 4:  # the key of the handshake
            return bytes(count)
        masks.append((b"a}]b", b"safe")[len(masks) % 2])
        return masks[-1]

    monkeypatch.setattr("websockets.frames.secrets.token_bytes", token_bytes)
    with bridged(simulation) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 5)
        assert len(masks) >= 2 * bridge.counters.telemetry_sent  # each frame was made twice


def test_a_script_sets_the_time_of_day_and_places_the_vehicle(
    simulation: Simulation,
) -> None:
    environment = {"Auto Time": "False", "Time Scale": "60", "Time": "1320", "Weather": "3", "Fog": "0.2"}
    pose = {"PosX": "3", "PosY": "4", "PosZ": "0.5", "RotX": "0", "RotY": "0", "RotZ": "0", "RotW": "1"}
    orders = environment | {f"V1 {key}": text for key, text in {"CoSim": "1", **pose}.items()}

    def position() -> list[float]:
        return simulation.frame.vehicles["V1"].pose.position.tolist()

    with bridged(simulation, Script(orders)) as bridge:
        wait_until(lambda: position() == [3.0, 4.0, 0.5])
        wait_until(lambda: simulation.frame.time_of_day == 22 * 3600.0)
        wait_until(lambda: simulation.frame.weather is not None)
        assert simulation.frame.weather is not None
        assert simulation.frame.weather.fog == 0.3  # light fog: the number comes before the amounts
        assert not simulation.frame.scene_light
        orders.update({"Auto Time": "True", "V1 CoSim": "0"})
        wait_until(lambda: (simulation.frame.time_of_day or 0.0) > 22 * 3600.0 + 6.0)  # 60 times as fast: 0.1 s
        wait_until(lambda: position()[2] < 0.1)  # it falls
        orders.update({"Weather": "0", "Rain": "0.4"})
        wait_until(lambda: simulation.frame.weather is not None and simulation.frame.weather.rain == 0.4)
        assert simulation.frame.weather.fog == 0.2
        received = bridge.counters.commands_received
        wait_until(lambda: bridge.counters.commands_received > received + 10)
        assert bridge.counters.refused_values == 0


def test_a_script_sets_the_traffic_lights_of_the_map_and_reads_their_program() -> None:
    orders = {"V1 Throttle": "0", "TL1 State": "0", "TL2 State": "3"}
    script = Script(orders)

    def reads(*expected: tuple[int, str]) -> bool:
        return bool(script.received) and all(script.received[-1][f"TL{n} State"] == text for n, text in expected)

    with Simulation(autodrive.make("tiny_town")) as simulation, bridged(simulation, script):
        wait_until(lambda: simulation.frame.traffic_lights["traffic_light_2"].mode == "set")
        wait_until(lambda: reads((1, "3"), (2, "3"), (4, "1")))  # 1 and 4 follow their program
        simulation.request(Reset()).result(LIMIT)  # the script still wants green
        wait_until(lambda: simulation.frame.traffic_lights["traffic_light_2"].mode == "set")
        orders["TL2 State"] = "0"
        wait_until(lambda: simulation.frame.traffic_lights["traffic_light_2"].mode == "program")
        simulation.request(Reset()).result(LIMIT)
        wait_until(lambda: reads((2, "1")))


def test_ambiguous_keys_are_reported(simulation: Simulation) -> None:
    with bridged(simulation) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 3)
        counters = bridge.counters
    assert counters.devkit == (
        "devkit 2023 (detected): keys 'V1 Throttle', LIDAR as text, positive steering turns left, its feedback is "
        "positive to the left, raw"
    )
    assert "--devkit-profile 2022" in counters.note
    settings = DevkitSettings(profile="2022")
    with bridged(simulation, settings=settings) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 3)
        assert bridge.counters.note == ""
        assert "devkit 2022 (chosen)" in bridge.counters.devkit
        assert "turns right" in bridge.counters.devkit


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_the_side_of_a_positive_command_can_be_chosen(simulation: Simulation, side: Side, sign: float) -> None:
    settings = DevkitSettings(steering=side)
    with bridged(simulation, Script({"V1 Throttle": "0.0", "V1 Steering": "1"}), settings=settings):
        wait_until(lambda: sign * simulation.frame.vehicles["V1"].steering > 0.1)


def test_while_the_simulation_is_paused_the_script_still_gets_the_state(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    with bridged(simulation, resend_delay=0.1) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 3)
        simulation.request(Pause()).result(LIMIT)
        wait_until(lambda: bridge.counters.resends >= 2)
    assert "no commands" not in caplog.text


def test_an_invalid_packet_is_counted_with_one_warning(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    invalid = ["hello", b"\x00\xff", "42[", '42["Bridge"]', '42["Other",{}]', '42["Bridge",[]]', "0", "9" * 5000]

    def sends_invalid_packets(connection: ServerConnection) -> None:
        for nonsense in invalid:
            connection.send(nonsense)
        Script()(connection)

    with bridged(simulation, sends_invalid_packets) as bridge:
        wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert (bridge.counters.bad_packets, bridge.counters.connections) == (len(invalid), 1)
    assert len(bridge_messages(caplog)) == 1


def test_refused_values_are_counted_with_one_warning(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    script = Script(FULL_THROTTLE | {"V1 Steering": "nan", "V7 Throttle": "1"})
    with bridged(simulation, script) as bridge:
        wait_until(lambda: bridge.counters.refused_values >= 20)
        wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
    assert len(bridge_messages(caplog)) == 1
    assert "V1 Steering: must be a finite number, not 'nan'" in caplog.text


def test_a_flood_of_commands_does_not_stop_the_simulation_and_is_not_answered_in_full(simulation: Simulation) -> None:
    def flood(connection: ServerConnection) -> None:
        reading = threading.Thread(target=lambda: list(telemetry_in(connection)), daemon=True)
        reading.start()
        for i in itertools.count():
            connection.send(packet(FULL_THROTTLE | {"V1 Throttle": f"{(i % 100) / 100}"}))

    with bridged(simulation, flood) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 10)
        ticks = simulation.ticks
        wait_until(lambda: bridge.counters.commands_received > 5000)
        wait_until(lambda: simulation.ticks > ticks + 20)
        assert bridge.counters.telemetry_sent <= simulation.ticks + 2


def test_the_status_says_that_a_script_has_ended_until_another_one_runs(simulation: Simulation) -> None:
    script = Server(lambda data: {"V1 Throttle": "0.1"}, port=0)
    port = script.port
    with DevkitBridge(simulation, "127.0.0.1", port) as bridge:
        wait_until(lambda: bridge.status == "connected" and bridge.counters.commands_received > 0)
        script.close()
        text = f"the script at 127.0.0.1:{port} has ended; the simulator connects again when it runs"
        wait_until(lambda: bridge.error == text)
        bridge.connect("127.0.0.1", free_port())
        wait_until(lambda: bridge.error.startswith("no script at 127.0.0.1:"))


def test_the_bridge_reconnects_after_a_break_within_a_websocket_frame(simulation: Simulation) -> None:
    visits: list[int] = []

    def breaking(connection: ServerConnection) -> None:
        visits.append(1)
        if len(visits) < 3:
            connection.recv()
            # RFC 6455: text frame, 16-bit length
            connection.socket.sendall(b"\x81\x7e\x04\x00only a few of 1024 bytes")
            connection.socket.shutdown(socket.SHUT_RDWR)
        else:
            Script()(connection)

    with bridged(simulation, breaking) as bridge:
        wait_until(lambda: simulation.frame.vehicles["V1"].speed > 0.1)
        assert bridge.counters.reconnects == 2


def test_a_server_without_websocket_is_tried_again_with_one_warning(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    with (
        socket.create_server(("127.0.0.1", 0)) as listener,
        DevkitBridge(simulation, port=listener.getsockname()[1]) as bridge,
    ):
        for _ in range(3):
            connection, _ = listener.accept()
            connection.recv(1000)
            connection.sendall(b"HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n")
            connection.close()
        assert bridge.status == "connecting"
    assert len(bridge_messages(caplog)) == 1
    assert "HTTP 404" in caplog.text


def test_a_server_that_comes_up_late_is_found(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    port = free_port()
    with DevkitBridge(simulation, port=port) as bridge:
        wait_until(lambda: "trying again" in caplog.text)
        with peer(Script(), port):
            wait_until(lambda: bridge.counters.commands_received > 3)
        assert bridge.counters.reconnects == 0


def test_host_and_port_can_be_changed_while_running(simulation: Simulation) -> None:
    with peer(Script()) as first, peer(Script()) as second, DevkitBridge(simulation, port=first) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 3)
        bridge.connect("localhost", second)
        assert bridge.address == f"localhost:{second}"
        wait_until(lambda: bridge.counters.reconnects == 1 and bridge.counters.commands_received > 10)


@pytest.mark.parametrize(("opening", "packets"), [("40", ["41", "1"]), (None, [])])
def test_close_sends_the_close_packets_to_a_server_of_engine_io(
    simulation: Simulation, opening: str | None, packets: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("autodrive.connect.bridge.session.CLOSE_TIMEOUT", LIMIT)
    last: list[str] = []

    def listening(connection: ServerConnection) -> None:
        if opening:
            connection.send(HANDSHAKE)
            connection.send(opening)
        for text in connection:
            last.append(str(text)[:2])
            if str(text).startswith("42"):  # the client reads no more after its close packets
                with contextlib.suppress(ConnectionClosed):  # it may have closed: the rest is still to be read
                    connection.send(packet(FULL_THROTTLE))

    with peer(listening) as port, DevkitBridge(simulation, port=port) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 3)
    assert [kind for kind in last if kind not in ("42", "2", "40")] == packets


def test_in_manual_mode_telemetry_is_sent_and_commands_are_ignored(simulation: Simulation) -> None:
    simulation.request(SetDrivingMode("V1", is_autonomous=False)).result(LIMIT)
    with bridged(simulation) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 30)
        assert simulation.frame.vehicles["V1"].throttle == 0.0


@pytest.mark.parametrize("key", ["V1 Reset", "Reset"])
def test_a_held_reset_resets_once(simulation: Simulation, key: str) -> None:
    script = Script(lambda number: {"V1 Throttle": "1", key: str(50 < number <= 60)})
    simulation.add_sink(resets := Resets())
    with bridged(simulation, script) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 80)
        assert bridge.counters.profile == "2025"
    assert resets.count == 1


def test_keys_without_effect_are_logged_once(simulation: Simulation, caplog: pytest.LogCaptureFixture) -> None:
    script = Script(lambda number: {"V1 Throttle": "0", "V1 Brake": "1", **({"V1 Horn\n": "1"} if number > 5 else {})})
    with bridged(simulation, script) as bridge:
        wait_until(lambda: bridge.counters.commands_received > 20)
    ignored = [line for line in bridge_messages(caplog) if "without effect" in line]
    assert ignored == [
        f"devkit bridge: keys of the script without effect: {key}" for key in ("'V1 Brake'", r"'V1 Horn\n'")
    ]


class Shown(Publisher):
    """The control of a simulation whose Frames the test shows."""

    def publish(self, frame: Frame) -> None:
        self._publish(frame)

    def submit(self, vehicle: str, command: Command) -> None:
        """Ignore it."""

    def renew(self, vehicle: str, command: Command) -> None:
        """Ignore it."""

    def request(self, request: Operation) -> None:
        """Ignore it."""


def with_image(frame: Frame) -> Frame:
    """The Frame with an image of the front camera of V1."""
    vehicle = frame.vehicles["V1"]
    pinhole = CameraIntrinsics(8, 8, 8.0, 8.0, 4.0, 4.0)
    image = CameraImage(frame.time, vehicle.pose, pinhole, np.full((8, 8, 4), 255, np.uint8))
    return replace(frame, vehicles={"V1": replace(vehicle, cameras={"front": image})})


@pytest.mark.parametrize("is_late", [False, True])
def test_the_first_message_waits_for_the_images(
    one_world: World, monkeypatch: pytest.MonkeyPatch, is_late: bool
) -> None:
    monkeypatch.setattr("autodrive.connect.bridge.session.IMAGE_WAIT", 0.1 if is_late else 10 * LIMIT)
    shown, script = Shown(one_world.reset(0)), Script()
    images: dict[str, Any] = {
        "images": lambda frame, _: {("V1", "front"): b"image"} if frame.vehicles["V1"].cameras else {},
        "image_sizes": lambda: {("V1", "front"): (8, 8)},
    }
    with bridged(shown, script, **images) as bridge:
        wait_until(lambda: bridge.status == "connected")
        if is_late:
            wait_until(lambda: script.received)
        shown.publish(with_image(shown.frame))
        wait_until(lambda: script.received)
    assert (script.received[0]["V1 Front Camera Image"] == black_image(8, 8)) is is_late


def test_images_that_make_a_message_too_long_are_omitted(simulation: Simulation) -> None:
    too_large = {("V1", "front"): b"\xff\xd8" + bytes(10**6)}
    sizes = dict.fromkeys([("V1", "front"), ("V1", "rear")], (64, 48))
    script = Script()
    with bridged(simulation, script, images=lambda *_: too_large, image_sizes=lambda: sizes) as bridge:
        wait_until(lambda: len(script.received) > 10)
        assert bridge.counters.oversized == 0
    shown = {data[f"V1 {side} Camera Image"] for data in script.received for side in ("Front", "Rear")}
    assert shown == {black_image(64, 48)}


def test_image_quality_is_reduced_until_the_message_fits(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    def images(_: Frame, share: float) -> dict[tuple[str, str], bytes]:
        return {("V1", "front"): b"\xff\xd8" + bytes(round(1.5e6 * share))}  # base64: 2 MB at full quality

    with bridged(simulation, script := Script(), settings=DevkitSettings(profile="2025"), images=images) as bridge:
        wait_until(lambda: len(script.received) > 10)
        assert bridge.counters.oversized == 0
    sizes = {len(base64.b64decode(data["V1 Front Camera Image"])) for data in script.received}
    assert sizes == {2 + round(1.5e6 * 0.45)}  # 0.9 MB in base64; 0.7 would be 1.4
    assert len([line for line in caplog.messages if "images are sent at 45% of their quality" in line]) == 1


def test_a_message_above_the_limit_of_the_server_is_never_sent(
    simulation: Simulation, caplog: pytest.LogCaptureFixture
) -> None:
    received: list[str] = []

    def small(connection: ServerConnection) -> None:
        connection.send(HANDSHAKE.replace("1000000", "2000"))
        for text in connection:
            received.append(str(text))
            if text == "40":
                connection.send('40{"sid":"y"}')

    with bridged(simulation, small, resend_delay=0.02) as bridge:
        wait_until(lambda: bridge.counters.oversized >= 2)
        assert bridge.counters.telemetry_sent == 0
    assert received == ["40", "41", "1"]
    assert len([line for line in caplog.messages if "limit of 2000 characters" in line]) == 1


def test_a_given_profile_is_used_from_the_first_message(simulation: Simulation) -> None:
    script = Script({"V1 Throttle": "1", "V1 Reset": "False"})
    with bridged(simulation, script, settings=DevkitSettings(profile="2020")) as bridge:
        wait_until(lambda: len(script.received) > 3)
        assert bridge.counters.profile == "2020"
    assert all("Throttle" in data and "V1 Throttle" not in data for data in script.received)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"port": 0}, "devkit port 0 is not between 1 and 65535"),
        ({"host": ""}, "devkit host '' is not a host name or IP address"),
        ({"host": "ws://robot"}, "devkit host 'ws://robot' is not"),
    ],
)
def test_invalid_options_raise_at_once(simulation: Simulation, options: dict[str, object], words: str) -> None:
    with pytest.raises(AutodriveError) as raised:
        DevkitBridge(simulation, **options)  # pyright: ignore[reportArgumentType]
    assert words in str(raised.value)
