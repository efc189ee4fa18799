"""`autodrive` with its page, as people start it: what is printed, served, loaded and drawn, and how it ends."""

from __future__ import annotations

import contextlib
import json
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from autodrive.app import PAGE
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import Command, LoadScenario
from autodrive.protocol.native import (
    PROTOCOL,
    SUBPROTOCOL,
    Done,
    Drive,
    Frame,
    Hello,
    Picture,
    Please,
    Scene,
    Subscribe,
)

from .test_cli import AUTODRIVE, PATIENCE, Started, refused

needs_page = pytest.mark.skipif(not (PAGE / "index.html").is_file(), reason="the page is not built: scripts/page")


def link_of(run: Started) -> str:
    """The one that a run prints once it is ready."""
    run.wait_for("in a browser:")
    found = re.search(r"in a browser: +(\S+)", run.messages.read_text())
    assert found
    return found[1]


@contextmanager
def started(folder: Path, *arguments: str) -> Iterator[tuple[Started, str]]:
    """A run with its page, and the link to it."""
    run = Started(folder, *arguments)
    try:
        yield run, link_of(run)
    finally:
        if run.process.poll() is None:
            run.end(signal.SIGTERM)


@contextmanager
def viewer(link: str) -> Iterator[ClientConnection]:
    """Somebody who has said Hello."""
    url = link.replace("http", "ws", 1).replace("/?", "/ws?") if "?" in link else link.replace("http", "ws", 1) + "ws"
    with connect(url, subprotocols=[SUBPROTOCOL], max_size=None, open_timeout=PATIENCE) as one:  # pyright: ignore
        one.send(encode(Hello(PROTOCOL, "visitor")))
        yield one


def await_message(one: ClientConnection, kind: type) -> Any:
    """The next message of that kind."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        data = one.recv(PATIENCE)
        assert isinstance(data, bytes)
        message = decode_server(data)
        if isinstance(message, kind):
            return message
    raise AssertionError(f"no {kind.__name__} came")


@needs_page
def test_autodrive_alone_is_the_standard_scenario_with_its_page(tmp_path: Path) -> None:
    with (tmp_path / "messages").open("w") as output:
        process = subprocess.Popen(AUTODRIVE, stdout=output, stderr=output)
    run = Started.__new__(Started)
    run.process, run.messages = process, tmp_path / "messages"
    try:
        link = link_of(run)
        with urllib.request.urlopen(link, timeout=PATIENCE) as answer:
            assert answer.read() == (PAGE / "index.html").read_bytes()
        with viewer(link) as one:
            assert await_message(one, Scene).scenario == "mini_map"
            assert not await_message(one, Frame).vehicles["V1"].is_autonomous  # a person may drive at once
    finally:
        assert run.end(signal.SIGINT) == 0


def test_with_viewers_connected_a_run_ends_at_once_and_says_goodbye(tmp_path: Path) -> None:
    with started(tmp_path, "plane", "--summary", str(tmp_path / "s.json")) as (run, link), viewer(link) as one:
        one.send(encode(Subscribe(frame_rate=None)))
        await_message(one, Frame)
        assert run.end(signal.SIGTERM) == 0
        with contextlib.suppress(ConnectionClosed):
            while one.recv(PATIENCE):
                pass
        assert one.close_code in {1001, 1012}  # going away, and where it is told, to be started again
    summary = json.loads((tmp_path / "s.json").read_text())
    assert (summary["ended_by"], summary["page"]["link"]) == ("SIGTERM", link)
    assert "Traceback" not in run.messages.read_text()


def test_another_scenario_comes_with_the_options_of_the_run(tmp_path: Path) -> None:
    arguments = ("plane", "--mode", "autonomous", "--seed", "5", "--summary", str(tmp_path / "s.json"))
    with started(tmp_path, *arguments) as (run, link), viewer(link) as one:
        assert list(await_message(one, Scene).vehicles) == ["V1"]
        one.send(encode(Please(1, LoadScenario("two_cars"))))
        assert list(await_message(one, Scene).vehicles) == ["V1", "V2"]
        assert all(vehicle.is_autonomous for vehicle in await_message(one, Frame).vehicles.values())
        for _ in range(200):  # scripts drive: the second car is there for its commands, too
            one.send(encode(Drive("V2", Command(throttle=1.0))))
            if await_message(one, Frame).vehicles["V2"].speed > 0.1:
                break
        run.end(signal.SIGINT)
    summary = json.loads((tmp_path / "s.json").read_text())
    assert (summary["scenario"], summary["seed"]) == ("two_cars", 5)
    assert summary["vehicles"]["V2"]["distance"] > 0.0


def test_pictures_come_to_who_asks_for_them(gl: str, tmp_path: Path) -> None:
    with started(tmp_path, "mini_map") as (_, link), viewer(link) as one:
        one.send(encode(Subscribe(picture_rate=10.0, picture_width=320)))
        picture = await_message(one, Picture)
        assert picture.jpeg.startswith(b"\xff\xd8")
        one.send(encode(Please(1, LoadScenario("night"))))
        await_message(one, Done)
        assert await_message(one, Picture).time < 60.0  # the new world's cameras see


def test_a_token_guards_the_page_and_stands_in_its_link(tmp_path: Path) -> None:
    with started(tmp_path, "plane", "--token", "open-sesame") as (_, link):
        assert link.endswith("/?token=open-sesame")
        with pytest.raises(urllib.error.HTTPError) as refusal:
            urllib.request.urlopen(link.partition("?")[0], timeout=PATIENCE)
        assert refusal.value.code == 403
        with viewer(link) as one:
            await_message(one, Frame)


def test_a_port_that_is_taken_is_a_fault_if_it_was_asked_for(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        assert f"port {port} of 127.0.0.1 is taken" in refused("run", "plane", "--port", str(port))


def test_headless_serves_nothing(tmp_path: Path) -> None:
    summary = tmp_path / "s.json"
    done = subprocess.run(
        [*AUTODRIVE, "run", "plane", "--headless", "--duration", "0.1", "--speed", "max", "--summary", str(summary)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=True,
    )
    assert json.loads(summary.read_text())["page"] is None
    assert "browser" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("environment", "line"),
    [
        ({"SSH_CONNECTION": "10.0.0.7 50000 10.0.0.9 22"}, "ssh -N -L 8731:127.0.0.1:8731 ada@10.0.0.9"),
        ({"DISPLAY": ":0"}, ""),
    ],
)
def test_who_is_logged_in_with_ssh_is_told_the_tunnel(environment: dict[str, str], line: str) -> None:
    code = "from autodrive.browser import tunnel, has_screen; print(tunnel('http://127.0.0.1:8731/'), has_screen())"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/usr/bin", "LOGNAME": "ada", **environment},
    )
    assert done.stdout.strip() == f"{line} {not line}".strip()
