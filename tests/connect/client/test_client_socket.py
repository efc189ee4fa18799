"""The client against servers of another WebSocket implementation, for cases that a simulator does not produce."""

from __future__ import annotations

import contextlib
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from http import HTTPStatus

import numpy as np
import pytest
import simplejpeg
from websockets import Subprotocol
from websockets.sync.server import ServerConnection, serve

from autodrive import AutodriveError, Client, CommandError, NoSimulatorError
from autodrive.connect.client.client_socket import Address, ClientSocket
from autodrive.protocol.codec import decode_client, encode
from autodrive.protocol.messages import CameraIntrinsics, Collision, Frame, LoadScenario, Pose, Reset
from autodrive.protocol.native import (
    PROTOCOL,
    SUBPROTOCOL,
    Error,
    Hello,
    Picture,
    Request,
    Response,
    Subscribe,
    Welcome,
)
from tests.support.waiting import LIMIT, free_port

WELCOME = encode(Welcome(PROTOCOL, "0.1.0", "script", {}))
POSE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))


def frame(tick: int, *events: Collision) -> Frame:
    return Frame(tick * 0.01, tick, {}, {}, events, True)


@contextlib.contextmanager
def serving(talk: Callable[[ServerConnection], object], port: int = 0, subprotocol: str = SUBPROTOCOL) -> Iterator[str]:
    """The address of a server that has this conversation after the client's first two messages."""

    def greet(connection: ServerConnection) -> None:
        assert isinstance(decode_client(connection.recv()), Hello)  # type: ignore[arg-type]
        assert isinstance(decode_client(connection.recv()), Subscribe)  # type: ignore[arg-type]
        with contextlib.suppress(Exception):
            talk(connection)

    def choose(_: ServerConnection, offered: Sequence[Subprotocol]) -> Subprotocol | None:
        return Subprotocol(subprotocol) if subprotocol in offered else None

    with serve(greet, "127.0.0.1", port, select_subprotocol=choose, close_timeout=0.1) as server:  # type: ignore[list-item]
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"127.0.0.1:{server.socket.getsockname()[1]}"
        server.shutdown()


@pytest.mark.parametrize(
    ("first", "words"),
    [
        (Error("version", "this simulator speaks version 3"), "this simulator speaks version 3"),
        (Welcome(3, "9.0", "script", {}), r"\(9\.0\) speaks version 3 .* this client version 2: install the same"),
        (Error("rate", "100 viewers are connected, and there is no room for more"), "no room"),
    ],
)
def test_a_simulator_that_refuses_a_client_gives_the_reason(first: object, words: str) -> None:
    with serving(lambda connection: connection.send(encode(first))) as address:
        with pytest.raises(AutodriveError, match=words) as caught:
            Client(address, timeout=LIMIT)
        assert not isinstance(caught.value, NoSimulatorError)  # trying again would not help


def test_a_simulator_of_version_1_is_named_as_the_reason() -> None:
    """It closes the connection after a message that version 2 does not know."""
    fault = {"type": "Fault", "code": "version", "text": "this simulator speaks version 1 of the protocol, not 2"}
    with (
        serving(lambda connection: connection.send(encode(fault)), subprotocol="autodrive.v1") as address,
        pytest.raises(AutodriveError, match="does not speak version 2 of the native protocol: install the same") as it,
    ):
        Client(address, timeout=LIMIT)
    assert not isinstance(it.value, NoSimulatorError)


def test_a_missing_simulator_error_gives_the_start_command() -> None:
    with pytest.raises(
        ConnectionError, match=r"no simulator listens at 127\.0\.0\.1:\d+: start a simulator with 'autodrive'"
    ):
        Client(f"127.0.0.1:{free_port()}", patience=0.0)


def test_another_web_server_is_no_simulator() -> None:
    def refuse(connection: ServerConnection, _: object) -> object:
        return connection.respond(HTTPStatus.NOT_FOUND, "nothing here")

    with serve(lambda _: None, "127.0.0.1", 0, process_request=refuse) as server:  # type: ignore[arg-type]
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with pytest.raises(AutodriveError, match=r"is not a simulator.*404"):
            Client(f"127.0.0.1:{server.socket.getsockname()[1]}", timeout=LIMIT)
        server.shutdown()


def test_a_server_that_does_not_answer_is_left_after_the_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    # Only the wait for the Welcome is short: a busy machine may need longer to connect.
    monkeypatch.setattr(
        "autodrive.connect.client.connection.ClientSocket", lambda address, _: ClientSocket(address, LIMIT)
    )
    with serving(lambda connection: connection.recv()) as address, pytest.raises(NoSimulatorError, match="no Welcome"):
        Client(address, timeout=0.2)


def test_fragments_pings_and_unknown_messages_are_accepted() -> None:
    ponged = threading.Event()

    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        connection.send(encode({"type": "Weather", "rain": 1.0}))
        whole = encode(frame(7))
        connection.send([whole[:5], whole[5:9], whole[9:]])
        ponged.set() if connection.ping().wait(LIMIT) else None
        connection.recv()

    with serving(talk) as address, Client(address, timeout=LIMIT) as sim:
        assert sim.wait().tick == 7
        with pytest.raises(TimeoutError, match="no Frame"):
            sim.wait(timeout=0.2)
        assert ponged.wait(LIMIT)


def test_events_of_skipped_frames_come_with_the_latest() -> None:
    bumps = [Collision(0.01 * tick, "V1", "box", 1.0, np.zeros(3)) for tick in (1, 2, 3)]

    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        for tick, bump in enumerate(bumps, 1):
            connection.send(encode(frame(tick, bump)))
        while isinstance(request := decode_client(connection.recv()), Request):  # type: ignore[arg-type]
            connection.send(encode(Response(request.id, frame(4))))
            connection.send(encode(frame(5)))

    with serving(talk) as address, Client(address, timeout=LIMIT) as sim:
        after = sim.reset()
        assert (after.tick, [event.time for event in after.events]) == (4, [0.01, 0.02, 0.03])
        assert sim.wait().events == ()


def test_a_picture_is_decoded_once_on_first_access() -> None:
    pixels = np.zeros((48, 64, 3), np.uint8)
    pixels[:, 32:] = 200, 60, 20
    jpeg = simplejpeg.encode_jpeg(pixels, quality=95)
    optics = CameraIntrinsics(64, 48, 50.0, 50.0, 32.0, 24.0)

    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        connection.send(encode(Picture("V1", "front", 0.5, POSE, optics, jpeg)))
        connection.recv()

    with serving(talk) as address, Client(address, picture_rate=10, timeout=LIMIT) as sim:
        image = sim.image("V1", "front")
        assert sim.image("V1", "front") is image
        assert sim.pictures["V1", "front"].jpeg == jpeg
    np.testing.assert_allclose(image[:, 48:].astype(int), pixels[:, 48:], atol=6)  # of JPEG at quality 95


def test_a_request_during_a_disconnection_is_a_connection_error_and_the_next_succeeds() -> None:
    asked: list[object] = []

    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        request = decode_client(connection.recv())  # type: ignore[arg-type]
        assert isinstance(request, Request)
        asked.append(request.operation)
        if len(asked) > 1:
            connection.send(encode(Response(request.id, frame(0))))
            connection.recv()

    with serving(talk) as address, Client(address, timeout=LIMIT, patience=LIMIT) as sim:
        with pytest.raises(ConnectionError, match=r"was lost.*during a Reset"):
            sim.reset(1)
        assert sim.reset(2).tick == 0
    assert asked == [Reset(1), Reset(2)]


def test_a_missing_answer_is_a_timeout_and_a_late_answer_is_ignored() -> None:
    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        first = decode_client(connection.recv())  # type: ignore[arg-type]
        second = decode_client(connection.recv())  # type: ignore[arg-type]
        assert isinstance(first, Request)
        assert isinstance(second, Request)
        connection.send(encode(Response(first.id, frame(1))))
        connection.send(encode(Error("request", "no", second.id)))
        connection.recv()

    with serving(talk) as address, Client(address, timeout=LIMIT) as sim:
        sim.connection.timeout = 0.3
        with pytest.raises(TimeoutError, match=r"a Reset was not answered within 0\.3 s"):
            sim.reset()
        sim.connection.timeout = LIMIT
        with pytest.raises(CommandError, match="no"):
            sim.pause()


def test_a_scenario_may_load_longer_than_other_answers_take() -> None:
    def talk(connection: ServerConnection) -> None:
        connection.send(WELCOME)
        request = decode_client(connection.recv())  # type: ignore[arg-type]
        assert isinstance(request, Request)
        time.sleep(0.3)
        connection.send(encode(Response(request.id, frame(1))))
        connection.recv()

    with serving(talk) as address, Client(address, timeout=LIMIT) as sim:
        sim.connection.timeout = 0.1
        assert sim.ask(LoadScenario("boxes")).tick == 1


def test_the_wait_for_a_lost_simulator_is_limited() -> None:
    with serving(lambda connection: connection.send(WELCOME)) as address:
        sim = Client(address, patience=0.3)
    with pytest.raises(NoSimulatorError, match=r"waited 0\.3 s"):
        sim.wait()


@pytest.mark.parametrize(
    ("text", "uri"),
    [
        ("127.0.0.1:8730", "ws://127.0.0.1:8730/ws"),
        ("lab-pc", "ws://lab-pc:8730/ws"),
        ("[::1]:9000", "ws://[::1]:9000/ws"),
        ("::1", "ws://[::1]:8730/ws"),
        ("http://[::1]:8731/?token=a", "ws://[::1]:8731/ws?token=a"),
        ("http://10.0.0.1:8731/?token=a-b_c", "ws://10.0.0.1:8731/ws?token=a-b_c"),
        ("https://hub.org/user/me/proxy/8730/", "wss://hub.org:443/user/me/proxy/8730/ws"),
        ("ws://10.0.0.1:8731/ws", "ws://10.0.0.1:8731/ws"),
    ],
)
def test_an_address_or_the_link_leads_to_the_socket(text: str, uri: str) -> None:
    assert Address.of(text).uri == uri


@pytest.mark.parametrize("text", ["", "ftp://here", "host:port", "host:99999999"])
def test_an_invalid_address_is_an_error_with_an_example(text: str) -> None:
    with pytest.raises(AutodriveError, match="is not the address of a simulator"):
        Client(text)


def test_the_client_loads_no_simulator() -> None:
    code = "import sys, autodrive; autodrive.Client; print(*sorted({name.split('.')[0] for name in sys.modules}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    heavy = {"mujoco", "numba", "moderngl", "pydantic", "yaml", "shapely", "trimesh", "simplejpeg", "uvicorn", "typer"}
    assert "numpy" in done.stdout.split()
    assert not heavy & set(done.stdout.split())
