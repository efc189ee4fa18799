"""The command line: output and exit codes of all commands."""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import json
import os
import pty
import re
import signal
import statistics
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from websockets.exceptions import ConnectionClosed
from websockets.sync.server import ServerConnection, serve

import autodrive
from autodrive.base.cache import PACKAGE
from autodrive.base.png import decode_png
from autodrive.cli import preview
from autodrive.connect.server.served import PageOptions
from autodrive.protocol.devkit_profile import DevkitSettings
from autodrive.recording.film.film import FilmOptions
from autodrive.recording.replay.session import ReplayOptions
from autodrive.run import RunOptions
from autodrive.run.race import RaceOptions
from autodrive.scenario.tracks.importer import ImportOptions
from tests.support.command_line import AUTODRIVE, call, interrupted_when, python, refused
from tests.support.scenes import needs_gl
from tests.support.waiting import LIMIT

DATA = Path(autodrive.__file__).parent / "scenario" / "data"
NOT_BUILT = [] if (PACKAGE / "page" / "index.html").is_file() else ["page"]
"""The check of doctor that fails in a checkout whose page is not built."""


# -- help and errors --------------------------------------------------------------------------------------------


def test_without_the_page_a_run_says_that_clients_cannot_connect() -> None:
    text = "clients and the direct ROS bridge cannot connect"
    assert text in call("run", "plane", "--headless", "--duration", "0.02").stderr
    assert text not in call("run", "plane", "--no-browser", "--port", "0", "--duration", "0.02").stderr
    for command in ("run", "race", "play"):
        assert "the direct ROS bridge cannot connect" in " ".join(call(command, "--help").stdout.split())


def test_a_command_uses_each_of_its_options() -> None:
    """`filled` passes on the arguments that are fields: one that is neither a field nor used would do nothing."""
    classes = (DevkitSettings, FilmOptions, ImportOptions, PageOptions, RaceOptions, ReplayOptions, RunOptions)
    fields = {options.__name__: {field.name for field in dataclasses.fields(options)} for options in classes}
    fields["DevkitSettings"] = {f"devkit_{name}" for name in fields["DevkitSettings"]}
    checked, unused = [], []
    for file in sorted(Path(autodrive.__file__).parent.joinpath("cli").glob("*.py")):
        for function in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            calls = [
                node for node in ast.walk(function) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
            ]
            if not isinstance(function, ast.FunctionDef) or not any(ast.unparse(node) == "locals()" for node in calls):
                continue
            filled = [ast.unparse(node.args[0]).split(".")[-1] for node in calls if ast.unparse(node.func) == "filled"]
            used = {node.id for node in ast.walk(function) if isinstance(node, ast.Name)}.union(
                *(fields[name] for name in filled)
            )
            unused += [f"{file.name}: {name.arg}" for name in function.args.args if name.arg not in used]
            checked += filled
    assert {*checked} == {*fields}
    assert unused == []


def test_help_names_every_command() -> None:
    done = call("--help")
    assert done.returncode == 0
    for command in ("run", "list", "show", "check", "urdf", "doctor"):
        assert re.search(rf"^  {command} ", done.stdout, re.MULTILINE)


def test_the_version_is_that_of_the_package() -> None:
    assert call("--version").stdout == f"autodrive {autodrive.__version__}\n"


@pytest.mark.process
def test_the_help_of_every_command_is_there_without_docstrings() -> None:
    """With `python -OO`."""
    program = (
        "import sys\nfrom typer.main import get_command\nfrom autodrive.cli.app import app, main\n"
        "sys.argv[1:] = ['--version']\ntry: main()\nexcept SystemExit: pass\n"
        "def texts(command, name):\n"
        "    print(name, '|', ' '.join((command.help or '').split()))\n"
        "    for one in getattr(command, 'commands', {}): texts(command.commands[one], f'{name} {one}')\n"
        "texts(get_command(app), 'autodrive')\n"
    )
    texts, stripped = (python(*option, "-c", program) for option in ([], ["-OO"]))
    assert stripped == texts
    assert len(texts.splitlines()) > 20
    assert all(re.search(r"\| \w", line) for line in texts.splitlines()[1:])
    helped = python("-OO", "-m", "autodrive", "weather", "--help")
    assert "Print what a weather means in numbers" in " ".join(helped.split())


@pytest.mark.process
def test_help_imports_neither_physics_nor_compiler() -> None:
    code = (
        "import sys; sys.argv[1:] = ['run', '--help']\nfrom autodrive.cli.app import main\ntry: main()\nfinally: "
        + ("print(sorted({'mujoco', 'numba', 'numpy', 'shapely'} & set(sys.modules)))")
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=LIMIT, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("fly",), "No such command 'fly'"),
        (("run", "--wings"), "No such option: --wings"),
        (("run", "mini_mapp"), "Did you mean 'mini_map'?"),
        (("run", "no_such.yaml"), "file 'no_such.yaml' does not exist"),
        (("run", "--speed", "fast"), "--speed must be a number from 1e-06 to 1e+06 or max, not 'fast'"),
        (("run", "--speed", "0"), "--speed must be a number from 1e-06 to 1e+06 or max, not '0'"),
        (("run", "--duration", "inf"), "--duration must be a number of seconds, not inf"),
        (("run", "--duration", "nan"), "Invalid value for '--duration': must be greater than or equal to 0"),
        (("run", "--duration", "-1"), "Invalid value for '--duration': must be greater than or equal to 0"),
        (("run", "--mode", "autopilot"), "'manual', 'autonomous'"),
        (("run", "--devkit", "here:there"), "--devkit must be HOST:PORT, for example 127.0.0.1:4567, not 'here:there'"),
        (("run", "--devkit", "127.0.0.1:70000"), "--devkit must be HOST:PORT, for example 127.0.0.1:4567"),
        (("run", "--devkit", "foo"), "--devkit must be HOST:PORT, for example 127.0.0.1:4567, not 'foo'"),
        (("run", "--devkit", "[::1]"), "--devkit must be HOST:PORT, for example 127.0.0.1:4567, not '[::1]'"),
        (("run", "--port", "70000"), "Invalid value for '--port': must be less than or equal to 65535"),
        (("run", "--seed", "1.5"), "Invalid value for '--seed': must be a whole number"),
        (("run", "--devkit-profile", "1999"), "'2020', '2022', '2023', '2025'"),
        (("run", "--summary", "no/such/folder/s.json"), "cannot write: No such file or directory"),
        (("race", "practice"), "a race has 1 to 8 scripts"),
        (("race", "practice", "--devkit", "foo"), "--devkit must be HOST:PORT, for example 127.0.0.1:4567"),
        (("list", "cars"), "'scenarios', 'maps', 'tracks', 'vehicles', 'modules', 'rulesets'"),
        (("show", "mini_mapp"), "Did you mean 'mini_map'?"),
        (("show", "mini_map", "-o", "map.gif"), "--output must end in .png or .svg, not '.gif'"),
        (("show", "mini_map", "-o", "no/such/folder/map.png"), "cannot write: No such file or directory"),
        (("show", "nigel", "-o", "nigel.png"), "--output is for images of maps and modules"),
        (("show", "nigel", "--occupancy", "maps"), "--occupancy and --labels are for maps, modules and scenarios"),
        (("show", "mini_map", "--labels", "map.gif"), "--labels must end in .png, not '.gif'"),
        (("show", "mini_map", "--labels", "no/such/folder/map.png"), "cannot write: No such file or directory"),
        (("check", "no_such.yaml"), "file 'no_such.yaml' does not exist"),
        (("check", "mini_mapp"), "Did you mean 'mini_map'?"),
    ],
)
def test_an_error_prints_one_line_and_exits_with_2(arguments: tuple[str, ...], text: str, tmp_path: Path) -> None:
    assert text in refused(*arguments, cwd=tmp_path)


# -- list, show, check, doctor ----------------------------------------------------------------------------------


@pytest.mark.parametrize("collection", ["scenarios", "maps", "vehicles", "modules", "rulesets"])
def test_list_prints_every_file_of_a_collection_with_its_title(collection: str) -> None:
    done = call("list", collection)
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()] == sorted(
        p.stem for p in (DATA / collection).glob("*.yaml")
    )
    assert all(len(line.split()) > 1 for line in done.stdout.splitlines())


def test_show_draws_a_map_as_png(tmp_path: Path) -> None:
    done = call("show", "mini_map", cwd=tmp_path)
    assert done.stdout == "wrote map 'mini_map' to mini_map.png\n"
    assert (tmp_path / "mini_map.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


def test_show_writes_an_occupancy_grid_and_labels(tmp_path: Path) -> None:
    done = call("show", "curved_road", "--occupancy", "maps/ros", "--labels", "labels.png", cwd=tmp_path)
    assert done.returncode == 0
    about = yaml.safe_load((tmp_path / "maps/ros/curved_road.yaml").read_text())
    assert (tmp_path / "maps/ros" / about["image"]).read_bytes().startswith(b"\x89PNG\r\n\x1a\n")
    assert (tmp_path / "labels.png").read_bytes().startswith(b"\x89PNG\r\n\x1a\n")


@pytest.fixture
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """3D images are small."""
    monkeypatch.setattr(preview, "SIZE", (320, 200))


@needs_gl
@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(("name", "options"), [("nigel", ()), ("straight_road", ("-o", "plan.png"))])
def test_show_renders_3d_images_and_draws_a_map_too_if_asked(
    tmp_path: Path, name: str, options: tuple[str, ...]
) -> None:
    done = call("show", name, *options, "--3d", "look.png", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    picture = decode_png((tmp_path / "look.png").read_bytes())
    assert picture.shape == (200, 320, 3)
    assert picture.std() > 10.0
    assert {path.name for path in tmp_path.glob("*.png")} == {"look.png", *options[1:]}
    assert all(f"to {name}" in done.stdout for name in ("look.png", *options[1:]))


@needs_gl
@pytest.mark.usefixtures("small")
def test_a_vehicle_at_night_has_its_lamps_on(tmp_path: Path) -> None:
    assert call("show", "nigel", "--night", "--3d", "night.png", cwd=tmp_path).returncode == 0
    picture = decode_png((tmp_path / "night.png").read_bytes())
    assert (picture.max(2) > 128).mean() > 0.02
    assert statistics.median(picture[60:150, 95:205].max(2).ravel()) > 20, "the car itself is nearly black"


@needs_gl
@pytest.mark.usefixtures("small")
def test_a_scenario_has_its_own_light_and_weather(tmp_path: Path) -> None:
    """By night the mini-map is darker than by day; on snow it is brighter, and more alike everywhere."""
    scenario = "map: mini_map\nvehicles: {V1: {type: nigel}}\n"
    (tmp_path / "snow.yaml").write_text(scenario + "weather: {snow_cover: 1.0}\n")
    pictures = {}
    for name in ("mini_map", "night", "snow.yaml"):
        assert call("show", name, "--3d", f"{name}.png", cwd=tmp_path).returncode == 0
        pictures[name] = decode_png((tmp_path / f"{name}.png").read_bytes()).astype(float)
    assert pictures["night"].mean() < 0.6 * pictures["mini_map"].mean()
    assert pictures["snow.yaml"].mean() > 1.1 * pictures["mini_map"].mean()


@needs_gl
@pytest.mark.usefixtures("small")
@pytest.mark.parametrize(("file", "text"), [("look.jpg", "must end in .png"), ("nowhere/look.png", "cannot write")])
def test_show_reports_why_it_cannot_render(tmp_path: Path, file: str, text: str) -> None:
    assert text in refused("show", "straight_road", "--3d", file, cwd=tmp_path)


def test_show_prints_a_vehicle_field_by_field() -> None:
    rows = dict(line.split(None, 1) for line in call("show", "nigel").stdout.splitlines() if len(line.split()) == 2)
    assert float(rows["wheelbase"]) == pytest.approx(0.14154)  # report: 141.54 mm


def test_show_accepts_the_kind_for_an_ambiguous_name() -> None:
    assert re.search(r"^map +mini_map$", call("show", "mini_map", "--kind", "scenario").stdout, re.MULTILINE)


@pytest.mark.parametrize("path", sorted(DATA.rglob("*.yaml")), ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_kind_of_every_shipped_file_is_detected(path: Path) -> None:
    from autodrive.cli.spec_files import kind_of_file

    assert f"{kind_of_file(path)}s" == path.parent.name


def test_check_reports_all_errors_of_a_file_and_of_its_references(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("map: plain\nvehicles:\n  V1: {type: nigel, x: far}\ntick: -1\nsped: 2\n")
    done = call("check", bad)
    assert done.returncode == 2
    for text in ("4 errors", "map 'plain' is not known", "vehicles.V1.x (line 3)", "tick (line 4)", "sped (line 5)"):
        assert text in done.stderr
    bad.write_text("map: plain\nvehicles: {V1: {type: nigel}}\n")
    assert "map 'plain' is not known. Known: " in refused("check", bad)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("mini_map", "scenario"),
        ("nigel", "vehicle"),
        ("lawn", "module"),
        (str(DATA / "scenarios" / "plane.yaml"), "scenario"),
    ],
)
def test_check_takes_a_name_and_prefers_the_scenario_that_run_would_run(name: str, kind: str) -> None:
    done = call("check", name)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{name}: {kind} '")


FAULTY = """title: All faults
map: street.yaml
vehicles:
  V1: {type: nigel, x: 0.0, y: 0.0}
  V2: {type: nigel, x: 0.1, y: 0.0}
  V3: {type: nigel, x: 50, y: 0.0}
  V4: {type: nigel, x: 1, yaw: 90}
  V5: {type: nigle, x: 1}
boxes:
  a: {x: 1.5, y: 1.0}
  b: {x: 1.52, y: 1.0}
  c: {x: 2.0, y: 0.5}
  d: {x: 0.0, y: 0.0}
"""
STREET = """title: Street
placements:
  - {module: straight_road, x: 0.0, y: 0.0, open: true}
  - {module: curve_9, x: 0.8, y: 0.2}
walls:
  - {points: [[-1, -1], [2, -1], [2, 2], [-1, 2]], is_closed: true, height: 0.25}
"""


def test_check_reports_the_faults_of_all_kinds_in_one_pass(tmp_path: Path) -> None:
    (tmp_path / "faulty.yaml").write_text(FAULTY)
    (tmp_path / "street.yaml").write_text(STREET)
    done = call("check", "faulty.yaml", cwd=tmp_path)
    assert done.returncode == 2
    wanted = [
        r"vehicles\.V4\.yaw \(line 7\): 'yaw' is not a known key\. .*Did you mean 'yaw_deg'\?",
        r"map \(line 2\): .*placement 2 'curve_9' \(line 4\): module 'curve_9' is not known\. .*\(street\.yaml\)",
        r"vehicles\.V5\.type \(line 8\): vehicle 'nigle' is not known\. .*Did you mean 'nigel'\?",
        r"warning: V3 \(line 6\) at \(50, 0\) is outside the walls of map 'street', which enclose x from -1 to 2 m",
        r"box 'a' \(line 10\) overlaps box 'b' \(line 11\) by 80 cm\^2",
        r"box 'c' \(line 12\) overlaps 'wall_2'",
        r"vehicles\.V2 \(line 5\): 'V1' and 'V2' overlap at the start",
        r"vehicles\.V1 \(line 4\): 'V1' and 'd' overlap at the start",
        r"vehicles\.V2 \(line 5\): 'V2' and 'd' overlap at the start",
    ]
    assert [text for text in wanted if not re.search(text, done.stderr)] == []
    assert f"{len(wanted)} errors" in done.stderr
    assert done.stderr.rstrip().endswith("(faulty.yaml)")


def test_a_scenario_without_a_vehicle_is_refused_by_check_and_run(tmp_path: Path) -> None:
    (tmp_path / "empty.yaml").write_text("map: plane\nvehicles: {}\n")
    for command in (("check",), ("run", "--headless")):
        assert "vehicles (line 2): there must be at least one vehicle" in refused(*command, "empty.yaml", cwd=tmp_path)


def test_a_fence_beside_the_road_encloses_no_vehicles(tmp_path: Path) -> None:
    fence = STREET.replace("curve_9, x: 0.8, y: 0.2", "lawn, x: 5, y: 0, length: 1, width: 1").replace("[[-1", "[[3")
    (tmp_path / "street.yaml").write_text(
        fence.replace("-1], [2, -1], [2, 2], [-1, 2]", "-1], [4, -1], [4, 1], [3, 1]")
    )
    (tmp_path / "mine.yaml").write_text("map: street.yaml\n")
    done = call("check", "mine.yaml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


def test_check_asks_for_the_kind_if_it_cannot_be_detected(tmp_path: Path) -> None:
    vague = tmp_path / "vague.yaml"
    vague.write_text("title: what am I?\n")
    assert "Name it with --kind" in refused("check", vague)
    assert call("check", vague, "--kind", "map").returncode == 0


def failed_checks(output: str) -> list[str]:
    """Subjects of the checks of doctor that failed."""
    return re.findall(r"^FAIL (\S+)", output, re.MULTILINE)


def test_doctor_passes_on_this_machine() -> None:
    done = call("doctor")
    assert failed_checks(done.stdout) == NOT_BUILT
    assert done.returncode == len(NOT_BUILT)
    assert done.stdout.splitlines()[-1] == ("1 failed." if NOT_BUILT else "All checks passed.")
    assert "ok   mujoco-core" in done.stdout


@pytest.mark.process
def test_doctor_prints_the_command_that_fixes_a_package_that_cannot_be_imported(tmp_path: Path) -> None:
    (tmp_path / "shapely.py").write_text("raise ImportError('libgeos.so: cannot open shared object file')\n")
    done = subprocess.run(
        [*AUTODRIVE, "doctor"],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        check=False,
    )
    assert done.returncode == 1
    assert re.search(r"^FAIL shapely +libgeos.so: cannot open shared object file$", done.stdout, re.MULTILINE)
    assert re.search(r"fix:  .* install .*--force-reinstall 'shapely>=2.1'$", done.stdout, re.MULTILINE)
    assert failed_checks(done.stdout) == ["shapely", *NOT_BUILT]


# -- run --------------------------------------------------------------------------------------------------------


def test_a_run_with_a_duration_ends_and_writes_its_summary(tmp_path: Path) -> None:
    arguments = "run plane --headless --mode autonomous --duration 2 --speed max --seed 5 --summary s.json"
    done = call(*arguments.split(), cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "s.json").read_text())
    assert (summary["scenario"], summary["seed"], summary["speed"]) == ("plane", 5, "max")
    assert (summary["ended_by"], summary["ticks"], summary["late_ticks"]) == ("duration", 200, 0)
    assert summary["simulated_time"] == pytest.approx(2.0, abs=1e-9)  # rounding of one product
    assert summary["real_time_factor"] == pytest.approx(2.0 / summary["wall_time"])
    assert [summary[part] for part in ("bridge", "page", "cameras")] == [None] * 3
    assert not re.search("browser|camera", done.stdout + done.stderr)
    vehicle = summary["vehicles"]["V1"]
    assert (vehicle["mode"], vehicle["collisions"]) == ("autonomous", 0)
    assert vehicle["distance"] < 1e-3  # no driver: it stands, except for settling
    assert "200 ticks" in done.stdout


@pytest.mark.process
@pytest.mark.wall_clock  # the status line is updated in real time
def test_on_a_terminal_the_status_line_is_updated(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    process = subprocess.Popen(
        [*AUTODRIVE, "run", "plane", "--headless", "--duration", "100"],
        stdout=theirs,
        stderr=theirs,
        env={**os.environ, "TERM": "xterm", "COLUMNS": "160"},
    )
    os.close(theirs)
    seen = b""

    def times() -> set[bytes]:
        return set(re.findall(rb"(\d\.\d) s  x", seen))

    with contextlib.suppress(OSError):  # Linux raises at the end of a terminal
        while chunk := os.read(ours, 65536):
            has_advanced = len(times()) > 3
            seen += chunk
            if len(times()) > 3 and not has_advanced:
                process.send_signal(signal.SIGINT)
    assert process.wait(LIMIT) == 0
    os.close(ours)
    assert len(times()) > 3  # the displayed time advances


@pytest.fixture
def devkit() -> Iterator[tuple[int, list[dict[str, str]]]]:
    """A script on the raw server of the C++ devkit that answers with full throttle: its port, and the telemetry."""
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
        thread.join(LIMIT)


def position(came: list[dict[str, str]]) -> float:
    """How far the car has driven straight on, as the last telemetry says [m]."""
    return max(abs(float(number)) for number in came[-1]["V1 Position"].split()[:2]) if came else 0.0


@pytest.mark.wall_clock  # script and simulation run at their own pace, as in a real run
def test_a_devkit_script_drives_the_car(devkit: tuple[int, list[dict[str, str]]], tmp_path: Path) -> None:
    port, came = devkit
    address, file = f"127.0.0.1:{port}", tmp_path / "s.json"
    with interrupted_when(lambda: position(came) > 0.3):
        done = call("run", "plane", "--headless", "--devkit", address, "--summary", file)
    assert done.returncode == 0, done.stderr
    summary = json.loads(file.read_text())
    vehicle, bridge = summary["vehicles"]["V1"], summary["bridge"]
    assert vehicle["mode"] == "autonomous"  # the default with --devkit
    assert vehicle["distance"] > 0.25
    # straight ahead on the plane: the distance is x, except for settling at the start
    assert vehicle["pose"]["position"][0] == pytest.approx(vehicle["distance"], rel=0.02)
    assert bridge["address"] == address
    assert abs(bridge["telemetry_sent"] - len(came)) <= 2  # one may be in transit, one may follow the count
    assert bridge["commands_received"] > 5
    assert bridge["round_trip"] > 0.0
    assert f"devkit at {address}" in done.stdout


@pytest.mark.wall_clock  # as above
def test_in_manual_mode_a_devkit_script_does_not_drive(
    devkit: tuple[int, list[dict[str, str]]], tmp_path: Path
) -> None:
    port, came = devkit
    address, file = f"127.0.0.1:{port}", tmp_path / "s.json"
    with interrupted_when(lambda: len(came) > 20):
        call("run", "plane", "--headless", "--devkit", address, "--mode", "manual", "--summary", file)
    summary = json.loads(file.read_text())
    assert summary["bridge"]["commands_received"] > 10
    assert summary["vehicles"]["V1"]["distance"] < 1e-3  # it stands, except for settling


# -- new ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["vehicle", "map", "scenario"])
def test_a_new_file_is_valid_and_is_not_overwritten(tmp_path: Path, what: str) -> None:
    done = call("new", what, "mine", cwd=tmp_path)
    assert done.stdout == "wrote mine.yaml. Next:  autodrive check mine.yaml\n"
    assert call("check", "mine.yaml", cwd=tmp_path).stdout.startswith(f"mine.yaml: {what} '")
    assert (
        "the file exists: replace it with --force, or choose another name  (mine.yaml)"
        in call("new", what, "mine", cwd=tmp_path).stderr
    )


def test_a_new_driver_is_a_program(tmp_path: Path) -> None:
    assert call("new", "driver", "mine", cwd=tmp_path).stdout == "wrote mine.py. Next:  python mine.py\n"
    compile((tmp_path / "mine.py").read_text(), "mine.py", "exec")


def test_show_prints_a_file_of_the_package() -> None:
    assert call("show", "nigel", "--yaml").stdout == (DATA / "vehicles" / "nigel.yaml").read_text()


def test_show_draws_a_module_as_svg_and_prints_its_size_and_ports(tmp_path: Path) -> None:
    _, footprint, *ports = call("show", "straight_road", "-o", "road.svg", cwd=tmp_path).stdout.splitlines()
    assert (tmp_path / "road.svg").read_text().startswith("<svg ")
    assert footprint.startswith("footprint: ")
    assert sorted(line.split("'")[1] for line in ports) == ["east", "west"]
