"""`autodrive` with its page: link, served files, scenarios, images, end of the run."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock
from urllib.parse import parse_qs, urlsplit

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

import autodrive
from autodrive.base import jit
from autodrive.base.cache import PACKAGE
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import Command, LoadScenario
from autodrive.protocol.native import (
    PROTOCOL,
    SUBPROTOCOL,
    Drive,
    Frame,
    Hello,
    Picture,
    Request,
    Response,
    Scene,
    Starting,
    Subscribe,
    Welcome,
)
from autodrive.run import PageOptions, Run, RunObserver, RunOptions, StopRequest, Summary, simulate
from autodrive.run.browser import has_screen, tunnel
from autodrive.run.compile_later import compile_later
from autodrive.run.first_picture import FirstPicture
from autodrive.run.runner import COMPILING
from autodrive.run.world_loader import WorldLoader
from autodrive.world import World
from tests.support.command_line import Started, refused
from tests.support.waiting import LIMIT, wait_until

needs_page = pytest.mark.skipif(
    not (PACKAGE / "page" / "index.html").is_file(), reason="the page is not built: scripts/page"
)


def link_of(run: Started) -> str:
    """The link that a run prints when it is ready."""
    run.wait_for("in a browser:")
    found = re.search(r"in a browser: +(\S+)", run.messages.read_text())
    assert found
    return found[1]


class ThreadedRun(RunObserver):
    """`simulate` in a thread, with a page on a free port."""

    def __init__(self, options: RunOptions) -> None:
        self.link = ""
        self._stop = StopRequest()
        self._executor = ThreadPoolExecutor(1)
        self._summary = self._executor.submit(
            simulate, replace(options, page=replace(options.page, port=0)), stop=self._stop, observer=self
        )
        wait_until(lambda: self.link or self._summary.done())
        if not self.link:
            self.end()  # raises its error

    def started(self, run: Run) -> None:
        self.link = run.link

    def end(self) -> Summary:
        """Stop the run."""
        self._stop.set("test")
        self._executor.shutdown()
        return self._summary.result()


@contextmanager
def started(options: RunOptions) -> Iterator[ThreadedRun]:
    """A run that ends with the block."""
    run = ThreadedRun(options)
    try:
        yield run
    finally:
        run.end()


@contextmanager
def viewer(link: str) -> Iterator[ClientConnection]:
    """A connected client."""
    url = link.replace("http", "ws", 1).replace("/?", "/ws?") if "?" in link else link.replace("http", "ws", 1) + "ws"
    with connect(url, subprotocols=[SUBPROTOCOL], max_size=None, open_timeout=LIMIT) as one:  # pyright: ignore
        one.send(encode(Hello(PROTOCOL, "visitor")))
        yield one


def await_message(one: ClientConnection, kind: type) -> Any:
    """The next message of that kind."""
    deadline = time.monotonic() + LIMIT
    while time.monotonic() < deadline:
        data = one.recv(LIMIT)
        assert isinstance(data, bytes)
        message = decode_server(data)
        if isinstance(message, kind):
            return message
    raise AssertionError(f"received no {kind.__name__}")


@needs_page
@pytest.mark.process
def test_autodrive_without_a_command_offers_the_scenarios_in_the_page_and_a_person_may_drive(tmp_path: Path) -> None:
    run = Started(tmp_path)
    try:
        link = link_of(run)
        with urllib.request.urlopen(link, timeout=LIMIT) as answer:
            assert answer.read() == (PACKAGE / "page" / "index.html").read_bytes()
        with viewer(link) as one:
            assert await_message(one, Welcome).has_start_screen
            assert await_message(one, Scene).scenario == "traffic"
            assert not await_message(one, Frame).vehicles["V1"].is_autonomous  # a person may drive
            one.send(encode(Request(1, LoadScenario("plane"))))
            await_message(one, Response)
        with viewer(link) as later:
            assert not await_message(later, Welcome).has_start_screen
    finally:
        assert run.end(signal.SIGINT) == 0


def test_the_page_is_served_before_the_world_is_made_and_clients_are_told_what_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    links, may_compile, may_end = list[str](), threading.Event(), threading.Event()
    load = WorldLoader.load

    def slow_load(loader: WorldLoader, scenario: str, when_read: Callable[[], None]) -> World:
        def compile_slowly() -> None:
            when_read()
            assert may_compile.wait(LIMIT)
            jit.show("tyre_force")
            assert may_end.wait(LIMIT)

        return load(loader, scenario, compile_slowly)

    monkeypatch.setattr(WorldLoader, "load", slow_load)
    monkeypatch.setattr(ThreadedRun, "serving", lambda run, link: links.append(link), raising=False)
    with ThreadPoolExecutor(1) as executor:
        run = executor.submit(ThreadedRun, RunOptions("plane"))
        try:
            wait_until(lambda: bool(links))
            with viewer(links[0]) as one:
                assert await_message(one, Starting) == Starting("loading the world", scenario="plane")
                may_compile.set()
                while (starting := await_message(one, Starting)).share is None:
                    pass
                assert (starting.stage, starting.scenario) == (COMPILING, "plane")
                may_end.set()
                assert await_message(one, Scene).scenario == "plane"
        finally:
            may_compile.set()
            may_end.set()
            run.result().end()


def test_clients_can_draw_the_start_of_a_scenario_before_its_world_is_compiled() -> None:
    options = RunOptions("traffic", seed=3)
    world = autodrive.make("traffic", seed=3)
    with SimulationServer(None, PageOptions(port=0)) as server, FirstPicture(server, options) as picture:
        picture.begin()
        with viewer(server.url) as early:
            while (starting := await_message(early, Starting)).scene is None:
                pass
            assert starting.frame is not None
            assert await_message(early, Starting).scene is None
        base = server.url.partition("?")[0]
        for path in (starting.scene.model, *(vehicle.model for vehicle in starting.scene.vehicles.values())):
            with urllib.request.urlopen(base + path) as answer:
                assert answer.read(4) == b"glTF"
        poses = {name: vehicle.pose for name, vehicle in starting.frame.vehicles.items()}
        assert poses.keys() == world.frame.vehicles.keys()
        for name, vehicle in world.frame.vehicles.items():  # plain Python may round in another way than compiled code
            assert poses[name].position == pytest.approx(vehicle.pose.position, abs=1e-9)


@pytest.mark.process
def test_what_a_run_may_need_later_is_compiled_by_a_process_that_ends_when_it_is_done() -> None:
    process = compile_later()
    assert process is not None
    assert process.wait(5 * LIMIT) == 0  # it has the lowest priority


def test_a_run_with_connected_clients_ends_at_once_and_closes_their_connections() -> None:
    with started(RunOptions("plane")) as run, viewer(run.link) as one:
        one.send(encode(Subscribe(frame_rate=None)))
        await_message(one, Frame)
        summary = run.end()
        with contextlib.suppress(ConnectionClosed):
            while one.recv(LIMIT):
                pass
        assert one.close_code in {1001, 1012}  # 1001: going away; 1012: service restart
    assert summary.ended_by == "test"
    assert summary.page
    assert summary.page.link == run.link


def test_another_scenario_is_loaded_with_the_options_of_the_run() -> None:
    with started(RunOptions("plane", mode="autonomous", seed=5)) as run, viewer(run.link) as one:
        assert list(await_message(one, Scene).vehicles) == ["V1"]
        one.send(encode(Request(1, LoadScenario("two_cars"))))
        assert list(await_message(one, Scene).vehicles) == ["V1", "V2"]
        assert all(vehicle.is_autonomous for vehicle in await_message(one, Frame).vehicles.values())
        for _ in range(200):  # scripts drive: commands for the second car are accepted, too
            one.send(encode(Drive("V2", Command(throttle=1.0))))
            if await_message(one, Frame).vehicles["V2"].speed > 0.1:
                break
    summary = run.end()
    assert (summary.scenario, summary.seed) == ("two_cars", 5)
    assert summary.vehicles["V2"].distance > 0.0


@pytest.mark.slow
def test_a_client_receives_the_images_that_it_subscribes_to(gl: str) -> None:
    with started(RunOptions("mini_map")) as run, viewer(run.link) as one:
        one.send(encode(Subscribe(picture_rate=10.0, picture_width=320)))
        picture = await_message(one, Picture)
        assert picture.jpeg.startswith(b"\xff\xd8")
        one.send(encode(Request(1, LoadScenario("night"))))
        await_message(one, Response)
        assert await_message(one, Picture).time < 60.0  # an image of the new world


def test_a_token_protects_the_page_and_is_part_of_its_link() -> None:
    with started(RunOptions("plane", page=PageOptions(token="open-sesame-0123"))) as run:
        link = run.link
        assert link.endswith("/?token=open-sesame-0123")
        with pytest.raises(urllib.error.HTTPError) as refusal:
            urllib.request.urlopen(link.partition("?")[0], timeout=LIMIT)
        assert refusal.value.code == 403
        with viewer(link) as one:
            await_message(one, Frame)


def test_a_requested_port_in_use_is_an_error(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert f"port {port} of 127.0.0.1 is in use" in refused("run", "plane", "--port", str(port))


@pytest.mark.parametrize(
    ("host", "tunnelled"),
    [("::1", "[::1]"), ("[::1]", "[::1]"), ("::", ""), ("0.0.0.0", ""), ("127.0.0.2", "127.0.0.2")],
)
def test_the_link_of_each_address_leads_to_the_simulator(host: str, tunnelled: str) -> None:
    run = ThreadedRun(RunOptions("plane", page=PageOptions(host=host)))
    try:
        with viewer(run.link):
            pass
        port = urlsplit(run.link).port
        if host == "::":  # all interfaces, also those of IPv4
            token = parse_qs(urlsplit(run.link).query)["token"][0]
            for address in ("127.0.0.1", "[::1]"):
                with viewer(f"http://{address}:{port}/?token={token}"):
                    pass
        with mock.patch.dict(os.environ, {"LOGNAME": "ada", "SSH_CONNECTION": "10.0.0.7 50000 10.0.0.9 22"}):
            expected = f"ssh -N -L {port}:{tunnelled}:{port} ada@10.0.0.9" if tunnelled else ""
            assert tunnel(run.link) == expected
    finally:
        run.end()


@pytest.mark.parametrize(
    ("environment", "command"),
    [
        ({"SSH_CONNECTION": "10.0.0.7 50000 10.0.0.9 22"}, "ssh -N -L 8731:127.0.0.1:8731 ada@10.0.0.9"),
        ({"DISPLAY": ":0"}, ""),
    ],
)
def test_an_ssh_session_shows_the_command_for_the_tunnel(environment: dict[str, str], command: str) -> None:
    with mock.patch.dict(os.environ, {"LOGNAME": "ada", **environment}, clear=True):
        assert tunnel("http://127.0.0.1:8731/") == command
        assert has_screen() == (not command)
