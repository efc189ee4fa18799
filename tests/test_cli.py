"""The command line as people run it: a process of its own, its output, its exit code."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

import autodrive
from autodrive.render.png import decode_png
from tests.render.scenes import needs_gl

AUTODRIVE = [sys.executable, "-c", "from autodrive.cli import main; main()"]

PATIENCE = 180.0
"""Wall time for one command [s]: a first one compiles, and the machine may be busy."""

DATA = Path(autodrive.__file__).parent / "data"


def call(*arguments: str | Path, cwd: Path | None = None, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [*AUTODRIVE, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        cwd=cwd,
        env={**os.environ, **environment},
        check=False,
    )


def refused(*arguments: str | Path, cwd: Path | None = None) -> str:
    """The one line that a fault is told in."""
    done = call(*arguments, cwd=cwd)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("autodrive: ")
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") == 1
    return done.stderr


class Started:
    """A run under way, its messages in a file so that no pipe fills up."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.messages = folder / "messages"
        with self.messages.open("w") as output:
            self.process = subprocess.Popen(
                [*AUTODRIVE, "run", *arguments], stdout=output, stderr=output, start_new_session=True
            )

    def wait_for(self, text: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while text not in self.messages.read_text():
            assert self.process.poll() is None, self.messages.read_text()
            assert time.monotonic() < deadline, self.messages.read_text()
            time.sleep(0.05)

    def end(self, number: signal.Signals) -> int:
        self.process.send_signal(number)
        return self.process.wait(PATIENCE)


# -- help and faults --------------------------------------------------------------------------------------------


def test_help_names_every_command() -> None:
    done = call("--help")
    assert done.returncode == 0
    for command in ("run", "list", "show", "check", "urdf", "doctor"):
        assert re.search(rf"^  {command} ", done.stdout, re.MULTILINE)


def test_the_version_is_that_of_the_package() -> None:
    assert call("--version").stdout == f"autodrive {autodrive.__version__}\n"


def test_help_loads_neither_physics_nor_compiler() -> None:
    code = "import sys; sys.argv[1:] = ['run', '--help']\nfrom autodrive.cli import main\ntry: main()\nfinally: " + (
        "print(sorted({'mujoco', 'numba', 'numpy', 'shapely'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("fly",), "No such command 'fly'"),
        (("run", "--wings"), "No such option: --wings"),
        (("run", "mini_mapp"), "Did you mean 'mini_map'?"),
        (("run", "no_such.yaml"), "there is no file 'no_such.yaml'"),
        (("run", "--speed", "fast"), "--speed is a positive number or max, not 'fast'"),
        (("run", "--speed", "0"), "--speed is a positive number or max, not '0'"),
        (("run", "--duration", "inf"), "--duration is a number of seconds, not inf"),
        (("run", "--duration", "nan"), "Invalid value for '--duration': Input should be greater than or equal to 0"),
        (("run", "--duration", "-1"), "Invalid value for '--duration': Input should be greater than or equal to 0"),
        (("run", "--mode", "autopilot"), "'manual', 'autonomous'"),
        (("run", "--devkit", "here:there"), "--devkit is HOST:PORT, for example 127.0.0.1:4567, not 'here:there'"),
        (("run", "--devkit", "127.0.0.1:70000"), "--devkit is HOST:PORT, for example 127.0.0.1:4567"),
        (("run", "--port", "70000"), "Invalid value for '--port'"),
        (("run", "--devkit-profile", "1999"), "'2020', '2022', '2023', '2025'"),
        (("run", "--summary", "no/such/folder/s.json"), "the summary cannot be written: No such file or directory"),
        (("list", "cars"), "'scenarios', 'maps', 'vehicles', 'modules'"),
        (("show", "mini_mapp"), "Did you mean 'mini_map'?"),
        (("show", "mini_map", "-o", "map.gif"), "--output ends in .png or .svg, not '.gif'"),
        (("show", "mini_map", "-o", "no/such/folder/map.png"), "the picture cannot be written"),
        (("show", "nigel", "-o", "nigel.png"), "--output is for pictures of maps and modules"),
        (("show", "nigel", "--occupancy", "maps"), "--occupancy and --labels are for maps, modules and scenarios"),
        (("show", "mini_map", "--labels", "map.gif"), "--labels ends in .png, not '.gif'"),
        (("show", "mini_map", "--labels", "no/such/folder/map.png"), "it cannot be written: No such file or directory"),
        (("check", "no_such.yaml"), "cannot be read: No such file or directory"),
    ],
)
def test_a_fault_is_one_clear_line_and_exit_code_2(arguments: tuple[str, ...], says: str, tmp_path: Path) -> None:
    assert says in refused(*arguments, cwd=tmp_path)


# -- list, show, check, doctor ----------------------------------------------------------------------------------


@pytest.mark.parametrize("shelf", ["scenarios", "maps", "vehicles", "modules"])
def test_list_names_every_file_of_the_shelf(shelf: str) -> None:
    done = call("list", shelf)
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == sorted(
        p.stem for p in (DATA / shelf).glob("*.yaml")
    )
    assert all(len(line.split()) > 1 for line in done.stdout.splitlines())  # each has a title


def test_show_draws_a_map_as_png(tmp_path: Path) -> None:
    done = call("show", "mini_map", cwd=tmp_path)
    assert done.stdout == "map 'mini_map' is drawn in mini_map.png\n"
    assert (tmp_path / "mini_map.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_show_draws_a_module_as_svg(tmp_path: Path) -> None:
    assert call("show", "curved_road", "-o", "road.svg", cwd=tmp_path).returncode == 0
    assert (tmp_path / "road.svg").read_text().startswith("<svg ")


def test_show_writes_an_occupancy_grid_and_labels(tmp_path: Path) -> None:
    done = call("show", "curved_road", "--occupancy", "maps/ros", "--labels", "labels.png", cwd=tmp_path)
    assert done.returncode == 0
    about = yaml.safe_load((tmp_path / "maps/ros/curved_road.yaml").read_text())
    assert (tmp_path / "maps/ros" / about["image"]).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert (tmp_path / "labels.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@needs_gl
@pytest.mark.parametrize("name", ["nigel", "straight_road"])
def test_show_draws_things_as_they_look(tmp_path: Path, name: str) -> None:
    done = call("show", name, "--3d", "look.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    picture = decode_png((tmp_path / "look.png").read_bytes())
    assert picture.shape == (1000, 1600, 3)
    assert picture.std() > 10.0


@needs_gl
@pytest.mark.parametrize(("file", "fault"), [("look.jpg", "ends in .png"), ("nowhere/look.png", "cannot be written")])
def test_show_tells_why_it_cannot_draw(tmp_path: Path, file: str, fault: str) -> None:
    done = call("show", "straight_road", "--3d", file, cwd=tmp_path)
    assert done.returncode == 2
    assert fault in done.stderr


def test_show_prints_a_vehicle_field_by_field() -> None:
    rows = dict(line.split(None, 1) for line in call("show", "nigel").stdout.splitlines() if len(line.split()) == 2)
    assert float(rows["wheelbase"]) == pytest.approx(0.14154)  # report: 141.54 mm


def test_show_takes_the_kind_where_a_name_is_used_twice() -> None:
    assert re.search(r"^map +mini_map$", call("show", "mini_map", "--kind", "scenario").stdout, re.MULTILINE)


@pytest.mark.parametrize("path", sorted(DATA.rglob("*.yaml")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_kind_of_every_shipped_file_is_told_by_its_content(path: Path) -> None:
    from autodrive.browse import kind_of_file

    assert f"{kind_of_file(path)}s" == path.parent.name


def test_check_finds_a_shipped_scenario_in_order() -> None:
    path = DATA / "scenarios" / "plane.yaml"
    done = call("check", path)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{path}: scenario '")


def test_check_tells_all_faults_of_a_file_and_what_it_names(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("map: plain\nvehicles:\n  V1: {type: nigel, x: far}\ntick: -1\nsped: 2\n")
    done = call("check", bad)
    assert done.returncode == 2
    for says in ("3 faults", "vehicles.V1.x (line 3)", "tick (line 4)", "sped (line 5)"):
        assert says in done.stderr
    bad.write_text("map: plain\nvehicles: {V1: {type: nigel}}\n")
    assert "map 'plain' is not known. Known: " in refused("check", bad)


def test_check_asks_for_the_kind_if_the_content_does_not_tell(tmp_path: Path) -> None:
    vague = tmp_path / "vague.yaml"
    vague.write_text("title: what am I?\n")
    assert "Say it with --kind" in refused("check", vague)
    assert call("check", vague, "--kind", "map").returncode == 0


def test_doctor_finds_this_machine_well() -> None:
    done = call("doctor")
    assert done.returncode == 0, done.stdout
    assert done.stdout.splitlines()[-1] == "All is well."
    assert "mujoco-core" in done.stdout


def test_doctor_gives_the_line_that_mends_a_package_that_cannot_be_imported(tmp_path: Path) -> None:
    (tmp_path / "shapely.py").write_text("raise ImportError('libgeos.so: cannot open shared object file')\n")
    done = call("doctor", PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    assert re.search(r"^BAD  shapely +libgeos.so: cannot open shared object file$", done.stdout, re.MULTILINE)
    assert re.search(r"mend it with:  .* install .*--force-reinstall 'shapely>=2.1'$", done.stdout, re.MULTILINE)
    assert "1 to mend." in done.stdout


# -- run --------------------------------------------------------------------------------------------------------


def test_a_run_of_some_seconds_ends_by_itself_and_writes_its_summary(tmp_path: Path) -> None:
    done = call(
        "run",
        "plane",
        "--headless",
        "--duration",
        "2",
        "--speed",
        "max",
        "--seed",
        "5",
        "--summary",
        "s.json",
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "s.json").read_text())
    assert (summary["scenario"], summary["seed"], summary["speed"]) == ("plane", 5, "max")
    assert (summary["ended_by"], summary["ticks"], summary["late_ticks"]) == ("duration", 200, 0)
    assert summary["simulated_time"] == pytest.approx(2.0, abs=1e-9)  # rounding of one product
    assert summary["real_time_factor"] == pytest.approx(2.0 / summary["wall_time"])
    assert summary["bridge"] is None
    vehicle = summary["vehicles"]["V1"]
    assert (vehicle["mode"], vehicle["collisions"]) == ("manual", 0)
    assert vehicle["distance"] < 1e-3  # nobody drives: it stands, but for settling
    assert "200 ticks" in done.stdout


def test_the_mode_asked_for_is_the_mode_it_runs_in(tmp_path: Path) -> None:
    call(
        "run",
        "plane",
        "--headless",
        "--mode",
        "autonomous",
        "--duration",
        "0.1",
        "--speed",
        "max",
        "--summary",
        tmp_path / "s.json",
    )
    assert json.loads((tmp_path / "s.json").read_text())["vehicles"]["V1"]["mode"] == "autonomous"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_cleanly_with_its_summary(number: signal.Signals, tmp_path: Path) -> None:
    run = Started(tmp_path, "plane", "--headless", "--summary", str(tmp_path / "s.json"))
    run.wait_for("Ctrl-C ends it")
    time.sleep(0.5)
    assert run.end(number) == 0
    summary = json.loads((tmp_path / "s.json").read_text())
    assert summary["ended_by"] == number.name
    assert summary["ticks"] > 0
    assert "Traceback" not in run.messages.read_text()


def test_on_a_terminal_the_status_line_is_alive(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*AUTODRIVE, "run", "plane", "--headless", "--duration", "1.5"],
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "160"},
    )
    os.close(theirs)
    seen = b""
    try:
        while chunk := os.read(ours, 65536):
            seen += chunk
    except OSError:  # Linux tells the end of a terminal so
        pass
    assert process.wait(PATIENCE) == 0
    os.close(ours)
    assert len(set(re.findall(rb"(\d\.\d) s  x", seen))) > 3  # the time is seen to run


@pytest.fixture
def devkit() -> Iterator[tuple[int, list[dict[str, str]]]]:
    """A script on the C++ devkit's server, which greets nobody; full throttle for every telemetry.

    Its port, and the telemetry that came.
    """
    came: list[dict[str, str]] = []

    def talk(connection: ServerConnection) -> None:
        with contextlib.suppress(ConnectionClosed):
            for message in connection:
                if isinstance(message, str) and message.startswith("42"):
                    came.append(json.loads(message[2:])[1])
                    connection.send('42["Bridge",{"V1 Throttle":"1.000000","V1 Steering":"0.000000"}]')

    with serve(talk, "127.0.0.1", 0, compression=None) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server.socket.getsockname()[1], came
        server.shutdown()
        thread.join(PATIENCE)


def test_a_devkit_script_drives_the_car(devkit: tuple[int, list[dict[str, str]]], tmp_path: Path) -> None:
    port, came = devkit
    done = call(
        "run",
        "plane",
        "--headless",
        "--devkit",
        f"127.0.0.1:{port}",
        "--duration",
        "4",
        "--summary",
        tmp_path / "s.json",
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "s.json").read_text())
    vehicle, bridge = summary["vehicles"]["V1"], summary["bridge"]
    assert vehicle["mode"] == "autonomous"  # who names a devkit wants to be driven by it
    assert vehicle["distance"] > 0.1
    # straight ahead on the plane: the way is the way along x, but for the settling at the start
    assert vehicle["pose"]["position"][0] == pytest.approx(vehicle["distance"], rel=0.02)
    assert bridge["address"] == f"127.0.0.1:{port}"
    assert len(came) > 10
    assert abs(bridge["telemetry_sent"] - len(came)) <= 2  # one may be under way, one may follow the count
    assert bridge["commands_received"] > 10
    assert 0.0 < bridge["round_trip"] < 1.0
    assert f"devkit at 127.0.0.1:{port}" in done.stdout


def test_in_manual_mode_a_devkit_script_does_not_drive(
    devkit: tuple[int, list[dict[str, str]]], tmp_path: Path
) -> None:
    port, _ = devkit
    address = f"127.0.0.1:{port}"
    call(
        "run",
        "plane",
        "--headless",
        "--devkit",
        address,
        "--mode",
        "manual",
        "--duration",
        "2",
        "--summary",
        tmp_path / "s.json",
    )
    summary = json.loads((tmp_path / "s.json").read_text())
    assert summary["bridge"]["commands_received"] > 0
    assert summary["vehicles"]["V1"]["distance"] < 1e-3  # it stands, but for settling
