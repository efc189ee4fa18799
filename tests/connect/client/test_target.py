"""A client without an address: it uses the run of its user in its folder, and drives no other one unasked."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path

import pytest

import autodrive
from autodrive import AutodriveError, Client, NoSimulatorError
from autodrive.base.cache import user_name
from autodrive.connect.client.last_run import NotedRun, last_run
from autodrive.connect.server.served import PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.native import RunOrigin
from autodrive.run import Run, RunObserver, RunOptions, StopRequest, simulate
from autodrive.world import World
from autodrive.world.simulation import Simulation
from tests.connect.client.conftest import bare
from tests.support.waiting import LIMIT, free_port, wait_until

Serve = Callable[..., AbstractContextManager[SimulationServer]]


@pytest.fixture
def user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A user with a cache of its own, in an own folder, on a machine where nothing listens at the default port."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.delenv("AUTODRIVE_PORT", raising=False)
    set_default_port(monkeypatch, free_port())
    folder = tmp_path / "folder"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def set_default_port(monkeypatch: pytest.MonkeyPatch, port: int) -> None:
    for module in ("client.target", "server.server"):
        monkeypatch.setattr(f"autodrive.connect.{module}.PORT", port)


@pytest.fixture(scope="module")
def world() -> World:
    return autodrive.make("plane")


@pytest.fixture
def serve(user: Path, world: World, monkeypatch: pytest.MonkeyPatch) -> Serve:
    """Serves a paused simulation that `user` has started; with a note as `autodrive run` if `has_note`."""

    @contextmanager
    def serving(*, user: str = user_name(), has_note: bool = False) -> Iterator[SimulationServer]:
        with ExitStack() as stack, Simulation(world, is_paused=True) as simulation:
            with monkeypatch.context() as patch:
                patch.setattr("autodrive.connect.server.server.user_name", lambda: user)
                server = SimulationServer(Served(simulation, bare), PageOptions(port=0))
            note = stack.enter_context(NotedRun(server.origin)) if has_note else None
            stack.enter_context(server)
            if note:
                note.write(server.address)
            yield server

    return serving


def test_a_client_uses_the_last_run_in_its_folder_and_says_so(
    serve: Serve, user: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with serve(user="bob") as other, serve(has_note=True) as first:
        set_default_port(monkeypatch, other.port)  # the port of the first one was taken
        with Client() as sim:
            assert sim.connection.address.port == first.port
        said = capsys.readouterr().err
        when = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d"
        assert re.fullmatch(
            rf"autodrive: connected to '.*' at 127\.0\.0\.1:{first.port}, started by {user_name()} at {when}\n", said
        )
        with serve(has_note=True) as second, Client() as sim:
            assert sim.connection.address.port == second.port
        with Client() as sim:
            assert sim.connection.address.port == first.port  # the second one has ended
        monkeypatch.chdir(user.parent)  # there is no run in this folder
        with pytest.raises(
            AutodriveError, match=rf"started by bob at {when}, is not a simulator of the user '{user_name()}'"
        ):
            Client()
        capsys.readouterr()
        with Client(other.address):  # an address may be of any user
            pass
        assert "connected" not in capsys.readouterr().err


def test_the_port_of_the_environment_is_used_if_the_last_run_agrees(
    serve: Serve, user: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with serve(user="bob") as other, serve(has_note=True) as own:
        monkeypatch.setenv("AUTODRIVE_PORT", str(other.port))
        with pytest.raises(AutodriveError, match=rf"AUTODRIVE_PORT is {other.port}, but .* 127\.0\.0\.1:{own.port}"):
            Client()
        monkeypatch.setenv("AUTODRIVE_PORT", str(own.port))
        with Client() as sim:
            assert sim.connection.address.port == own.port
        monkeypatch.chdir(user.parent)
        monkeypatch.setenv("AUTODRIVE_PORT", str(other.port))
        with Client() as sim:  # chosen by the user
            assert sim.connection.address.port == other.port


@pytest.mark.parametrize("port", ["0", "65536", "8730x", "-1", "٨"])
def test_a_wrong_port_in_the_environment_is_refused(port: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AUTODRIVE_PORT", port)
    for use in (Client, lambda: SimulationServer(None)):
        with pytest.raises(AutodriveError, match="AUTODRIVE_PORT must be a port, 1 to 65535, not"):
            use()


def test_a_simulator_that_is_not_the_last_run_is_refused_at_its_address(serve: Serve) -> None:
    with serve() as other, NotedRun(RunOrigin("0123", user_name(), 0.0)) as note:
        note.write(other.address)
        with pytest.raises(AutodriveError, match="is not the last run in this folder, started by"):
            Client()


def test_the_note_of_a_process_that_has_ended_counts_no_more(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = (
        "import os; from autodrive.connect.client.last_run import NotedRun, last_run; "
        "from autodrive.protocol.native import RunOrigin; "
        "NotedRun(RunOrigin('1', 'user', 1.0)).write('127.0.0.1:1'); print(last_run()); os._exit(0)"
    )
    killed = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "127.0.0.1:1" in killed.stdout
    notes = user.parent / "cache" / "autodrive" / "runs"
    assert [file.name for file in notes.iterdir()] == ["1.json"]
    assert last_run() is None
    os.mkfifo(notes / "pipe.json")
    with NotedRun(RunOrigin("2", "user", 2.0)):
        assert [file.name for file in notes.iterdir()] == ["2.json"]  # the old ones are removed
    assert [*notes.iterdir()] == []


def test_a_run_without_a_folder_that_can_be_written_has_no_note(user: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cache = user.parent / "cache"
    cache.write_text("no folder: a read-only home")
    with NotedRun(RunOrigin("1", "user", 1.0)):
        assert last_run() is not None  # among the temporary files
    (temporary,) = user.parent.glob("autodrive-*")
    temporary.chmod(0o777)  # anybody could have written the notes in it
    with NotedRun(RunOrigin("2", "user", 1.0)):
        assert last_run() is None


def test_a_run_is_noted_from_its_start_to_its_end(user: Path) -> None:
    class Observer(RunObserver):
        def started(self, run: Run) -> None:
            assert run.server is not None
            note = last_run()
            assert note is not None
            assert (note.address, note.origin, note.folder) == (run.server.address, run.server.origin, str(user))
            with Client() as sim:
                assert sim.simulator.startswith(
                    f"'{run.simulation.world.spec.title}' at {run.server.address}, started by {user_name()} at "
                )
            stop.set()

    stop = StopRequest()
    simulate(RunOptions("plane", page=PageOptions(port=0)), stop=stop, observer=Observer())
    assert last_run() is None


def test_a_client_waits_for_a_simulator_that_starts(
    serve: Serve, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ports: list[int] = []

    def connect() -> None:
        with Client(patience=LIMIT) as sim:
            ports.append(sim.connection.address.port)

    thread = threading.Thread(target=connect)
    thread.start()
    said = ""

    def is_waiting() -> bool:
        nonlocal said
        said += capsys.readouterr().err
        return "start a simulator with 'autodrive'" in said

    wait_until(is_waiting)
    assert f"autodrive: waiting up to {LIMIT:g} s: no simulator listens at" in said
    with serve(has_note=True) as server:  # at another port than the one at which it waits
        thread.join(LIMIT)
    assert ports == [server.port]


def test_an_address_that_cannot_be_right_is_not_waited_for() -> None:
    with pytest.raises(NoSimulatorError, match="cannot connect to"):
        Client("no-such-host.invalid", patience=LIMIT)
