"""The folder of the user: listed, opened and saved by clients; nothing outside of it is read or written."""

from __future__ import annotations

import os
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import autodrive
from autodrive import AutodriveError, Client
from autodrive.base.png import decode_png
from autodrive.connect.server.served import OwnFiles, PageOptions, Served
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.messages import MapModule, SaveScenario, TrackLine, UseMap
from autodrive.protocol.own_files import ExportMap, ListFiles, OpenFile, OwnFile, SaveFile
from autodrive.run.options import RunOptions
from autodrive.run.own_files import UserFiles
from autodrive.run.world_loader import WorldLoader
from autodrive.scenario import kinds
from autodrive.scenario.kinds import Kind
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.raster import occupancy
from autodrive.scenario.maps.spec import MAX_PLACEMENTS
from autodrive.scenario.tracks.track import Track
from autodrive.world.simulation import Simulation
from tests.support.native_clients import native_client, scene_files

TRACK = TrackLine(((0.0, 0.0), (6.0, 0.0), (9.0, 3.0), (6.0, 6.0), (0.0, 6.0)))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "loop.yaml").write_text("title: My loop\npoints: [0 0, 9 0, 9 6, 0 6]\nwidth: 1.0\n")
    (tmp_path / "mine" / "town.yml").write_text("placements: [{module: lawn, x: 0, y: 0}]\n")
    (tmp_path / "mine" / "two.yaml").write_text("title: 'Two'\nmap: mini_map\nvehicles: {V1: {}, V2: {x: 2}}\n")
    (tmp_path / "mine" / "notes.txt").write_text("no map")
    (tmp_path / "secret.yaml").write_text("title: Secret\nmap: plane\n")
    return tmp_path / "mine"


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with Simulation(autodrive.make("mini_map"), load=autodrive.make) as running:
        yield running


@pytest.fixture
def server(simulation: Simulation, folder: Path) -> Iterator[SimulationServer]:
    served = Served(simulation, scene_files, scenarios={"plane": "Plane"}, own_files=UserFiles(folder))
    with SimulationServer(served, PageOptions(port=0)) as serving:
        yield serving


@pytest.fixture
def sim(server: SimulationServer) -> Iterator[Client]:
    with Client(server.address) as client:
        yield client


def ask(sim: Client, operation: OpenFile | ListFiles | SaveFile | ExportMap | SaveScenario) -> str:
    sim.connection.request(operation)
    return sim.connection.text


def test_a_file_whose_name_is_not_utf_8_locks_nobody_out(server: SimulationServer, folder: Path, sim: Client) -> None:
    for name in (b"stra\xdfe.yaml", b"stra\xdee.yaml"):
        (folder / os.fsdecode(name)).write_text("title: Latin-1\nmap: plane\n")
    with native_client(server) as it:
        latin = [name for name, file in it.ask("ListFiles")["files"].items() if file["title"] == "Latin-1"]
        assert latin == ["stra\\xdee.yaml", "stra\\xdfe.yaml"]
        assert it.ask("OpenFile", name="stra\\xdfe.yaml")["type"] == "Response"
        assert it.ask("Pause")["frame"]["time"] >= 0.0
    sim.step({})


class UnfitFiles(OwnFiles):
    """Its answer has a number that MessagePack does not have."""

    def listed(self) -> dict[str, OwnFile]:
        return {"a.yaml": OwnFile("map", 2**64)}  # type: ignore[arg-type]


def test_an_answer_that_cannot_be_encoded_is_an_error_and_the_next_requests_are_executed(
    simulation: Simulation,
) -> None:
    served = Served(simulation, scene_files, own_files=UnfitFiles())
    with (
        SimulationServer(served, PageOptions(port=0)) as server,
        native_client(server) as it,
        native_client(server) as other,
    ):
        assert it.ask("ListFiles")["type"] == "Error"
        for client in (it, other):
            assert client.ask("Pause")["type"] == "Response"
            assert client.ask("ListFiles")["type"] == "Error"


def test_the_files_of_the_folder_are_listed_and_opened(
    server: SimulationServer, simulation: Simulation, sim: Client
) -> None:
    with native_client(server) as it:
        assert it.until("Welcome")["folder"] == "mine"
        assert it.ask("ListFiles")["files"] == {
            "loop.yaml": {"kind": "track", "title": "My loop"},
            "town.yml": {"kind": "map", "title": ""},
            "two.yaml": {"kind": "scenario", "title": "Two"},
        }
    ask(sim, OpenFile("loop.yaml"))
    assert simulation.world.map.track is not None
    assert simulation.undo_name == "open a map"
    ask(sim, OpenFile("two.yaml"))
    assert simulation.world.vehicle_names == ("V1", "V2") or [*simulation.world.vehicle_names] == ["V1", "V2"]
    assert simulation.undo_name == ""


OWN = "title: Own\nplacements:\n  - {module: MODULE, x: 0.0, y: 0.0, open: true}\n"
"""The file of a map with an own module."""


def test_a_map_of_the_folder_has_own_modules_of_the_folder(
    sim: Client, simulation: Simulation, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir("/")
    (folder / "parts").mkdir()
    text = kinds.find("module", "straight_road").read_text()
    (folder / "parts" / "road.yaml").write_text(text.replace("title: ", "title: My "))
    (folder / "own.yaml").write_text(OWN.replace("MODULE", "parts/road.yaml"))
    ask(sim, OpenFile("own.yaml"))
    found = simulation.world.specs.map.modules["parts/road.yaml"].spec_or_none
    assert found is not None
    assert found.title.startswith("My ")
    sim.edit_map({"next": MapModule("parts/road.yaml", 0.0, 3.0, open=True)})
    sim.undo()
    sim.redo()
    assert [one.placement.module for one in simulation.world.map.modules] == ["parts/road.yaml"] * 2
    ask(sim, SaveFile("saved"))
    sim.use_map("plane")
    ask(sim, OpenFile("saved.yaml"))
    assert len(simulation.world.map.modules) == 2
    sim.reset()


@pytest.mark.parametrize("module", ["../secret.yaml", "/etc/passwd.yaml", "link.yaml", "parts/../../secret.yaml"])
def test_own_modules_outside_of_the_folder_are_not_read(
    sim: Client, simulation: Simulation, folder: Path, module: str
) -> None:
    (folder / "link.yaml").symlink_to(folder.parent / "secret.yaml")
    (folder / "own.yaml").write_text(OWN.replace("MODULE", module))
    before = simulation.world
    with pytest.raises(AutodriveError, match=f"module '{module}' is not in the folder 'mine'"):
        ask(sim, OpenFile("own.yaml"))
    assert simulation.world is before


ROAD = kinds.find("module", "straight_road").read_text()


@pytest.fixture
def secrets(folder: Path) -> Path:
    """A folder with valid files, which no client may read; `note` is written by its Python file."""
    secrets = folder.parent / "secrets"
    secrets.mkdir()
    files: dict[Kind, str] = {"vehicle": "nigel", "map": "plane", "track": "practice", "ruleset": "practice"}
    for kind, name in files.items():
        (secrets / f"{kind}.yaml").write_text(kinds.find(kind, name).read_text())
    (secrets / "module.yaml").write_text(ROAD)
    (secrets / "sensor.py").write_text(f"open({str(folder.parent / 'note')!r}, 'w')\nclass Sensor: pass\n")
    return secrets


@pytest.fixture
def loaded(folder: Path) -> Iterator[Client]:
    """A client of a simulator with the loader of `autodrive run plane --folder`."""
    loader = WorldLoader(RunOptions("plane", folder=folder, cameras=False))
    with Simulation(loader.load("plane"), load=loader.load) as simulation:
        served = Served(simulation, scene_files, scenarios=loader.scenarios, own_files=UserFiles(folder))
        with SimulationServer(served, PageOptions(port=0)) as server, Client(server.address) as sim:
            yield sim


def test_a_module_that_a_client_has_named_by_a_path_is_not_read_from_there(
    loaded: Client, folder: Path, secrets: Path
) -> None:
    path = str(secrets / "module.yaml")
    loaded.ask(UseMap(text=OWN.replace("MODULE", path), modules={path: ROAD}))
    text = ask(loaded, SaveScenario())
    ask(loaded, SaveFile("mine", "scenario"))
    assert path in (folder / "mine.yaml").read_text()
    for operation in (OpenFile("mine.yaml"), OpenFile("sent.yaml", text)):
        with pytest.raises(
            AutodriveError, match=r"'module\.yaml' is not a file of the scenario .*, and not in the folder 'mine'"
        ):
            ask(loaded, operation)


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("vehicle", "vehicles: {V1: {type: PATH}}"),
        ("vehicle", "traffic: {cars: 1, type: PATH}"),
        ("map", "map: PATH"),
        ("track", "map: PATH"),
        ("track", "race: {track: PATH}"),
        ("ruleset", "map: practice\nrace: {rules: PATH}"),
        ("module", "map: {title: Own, placements: [{module: PATH, x: 0, y: 0, open: true}]}"),
        ("sensor", "vehicles: {V1: {own_sensors: {radar: 'PATH:Sensor'}}}"),
        ("map of the folder", "map: town.yaml"),
    ],
)
@pytest.mark.parametrize("is_link", [False, True])
def test_a_scenario_of_the_folder_reads_no_file_outside_of_it(
    loaded: Client, folder: Path, secrets: Path, kind: str, text: str, is_link: bool
) -> None:
    path = secrets / (
        "module.yaml" if kind == "map of the folder" else "sensor.py" if kind == "sensor" else f"{kind}.yaml"
    )
    if is_link:
        (folder / path.name).symlink_to(path)
        path = folder / path.name
    (folder / "town.yaml").write_text(OWN.replace("MODULE", str(path)))
    (folder / "mine.yaml").write_text(
        "title: Mine\nvehicles: {V1: {}}\n" * ("vehicles" not in text) + text.replace("PATH", str(path))
    )
    with pytest.raises(AutodriveError, match=f"'{path.name}' is not a file of the scenario"):
        ask(loaded, OpenFile("mine.yaml"))
    assert not (folder.parent / "note").exists()
    if is_link and path.suffix == ".yaml":
        with pytest.raises(AutodriveError, match=f"'{path.name}' is a link to a place outside the folder 'mine'"):
            ask(loaded, OpenFile(path.name))


def test_files_of_the_folder_and_of_the_start_are_read(loaded: Client, folder: Path, secrets: Path) -> None:
    for path in secrets.iterdir():
        path.rename(folder / path.name)
    sample = "def sample(self, view, random):\n        return (0.0,)"
    (folder / "sensor.py").write_text(f"class Sensor:\n    rate, columns = 1.0, ('x [m]',)\n    {sample}\n")
    files = (
        "vehicles: {V1: {type: vehicle.yaml, own_sensors: {radar: 'sensor.py:Sensor'}}}\n"
        "race: {track: track.yaml, rules: ruleset.yaml}\n"
    )
    (folder / "all.yaml").write_text(f"title: All\nmap: track.yaml\n{files}")
    (folder / "town.yaml").write_text(OWN.replace("MODULE", "module.yaml"))
    ask(loaded, OpenFile("all.yaml"))
    assert loaded.scene.title == "All"
    ask(loaded, OpenFile("town.yaml"))
    start = folder.parent / "start.yaml"
    start.write_text("title: Start\nmap: there.yaml\n")
    (folder.parent / "there.yaml").write_text(kinds.find("map", "plane").read_text())
    loader = WorldLoader(RunOptions(str(start), folder=folder, cameras=False))
    loader.load(str(start)).close()
    (folder / "again.yaml").write_text(f"title: Again\nmap: {folder.parent / 'there.yaml'}\n")
    loader.load(str(folder / "again.yaml")).close()
    loader.load(str(start)).close()
    loader.load("mini_map").close()


@pytest.mark.parametrize("is_link", [False, True])
def test_what_is_no_regular_file_is_neither_listed_nor_opened_nor_written(
    loaded: Client, folder: Path, is_link: bool
) -> None:
    place = folder.parent if is_link else folder
    os.mkfifo(place / "pipe.yaml")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(place / "socket.yaml"))
    (place / "folder.yaml").mkdir()
    names = ["pipe", "socket", "folder"]
    if is_link:
        for name in names:
            (folder / f"{name}.yaml").symlink_to(place / f"{name}.yaml")
        (folder / "device.yaml").symlink_to("/dev/zero")
        names.append("device")
    assert UserFiles(folder).listed().keys() == {"loop.yaml", "town.yml", "two.yaml"}
    for name in names:
        with pytest.raises(
            AutodriveError, match="is not a regular file" if not is_link else "is a link to another place"
        ):
            ask(loaded, SaveFile(name, replaces=True))
        with pytest.raises(AutodriveError, match=f"'{name}.yaml' is (not in|a link to a place outside) the folder"):
            ask(loaded, OpenFile(f"{name}.yaml"))
    os.mkfifo(folder / "sensor.py")
    (folder / "mine.yaml").write_text("vehicles: {V1: {own_sensors: {radar: 'sensor.py:Sensor'}}}")
    with pytest.raises(AutodriveError, match="cannot be read: it is not a regular file"):
        ask(loaded, OpenFile("mine.yaml"))


@pytest.mark.parametrize("name", ["../secret.yaml", "notes.txt", "/etc/passwd", "", "loop", "\0", "mine/../loop.yaml"])
def test_what_is_not_in_the_folder_is_not_opened(sim: Client, simulation: Simulation, name: str) -> None:
    before = simulation.world
    with pytest.raises(AutodriveError, match="is not in the folder 'mine'"):
        ask(sim, OpenFile(name))
    assert simulation.world is before


def test_a_map_is_saved_opened_again_and_replaced_only_if_that_is_wanted(
    sim: Client, simulation: Simulation, folder: Path
) -> None:
    sim.edit_track(TRACK)
    assert ask(sim, SaveFile("round", "map", "Round")) == "round.yaml"
    track = Track.load(folder / "round.yaml")
    assert track.title == "Round"
    before = (folder / "round.yaml").read_text()
    sim.use_map("oval")
    with pytest.raises(AutodriveError, match=r"'round.yaml' is in the folder already: choose another name, or replace"):
        ask(sim, SaveFile("round"))
    assert (folder / "round.yaml").read_text() == before
    ask(sim, OpenFile("round.yaml"))
    assert simulation.world.map.track is not None
    assert simulation.world.map.track.length == track.length
    sim.use_map("oval")
    ask(sim, SaveFile("round", "scenario", "Oval", replaces=True))
    assert UserFiles(folder).listed()["round.yaml"] == OwnFile("scenario", "Oval")
    assert autodrive.make(str(folder / "round.yaml")).map.bounds == simulation.world.map.bounds


@pytest.mark.parametrize(
    "name", ["../round", "a/b", "a\\b", ".hidden", "", "con", "LPT1", "a" * 61, "a.b", "a\n", "~", "\0", "a:b", "ä/"]
)
def test_a_name_that_leaves_the_folder_is_refused(sim: Client, folder: Path, name: str) -> None:
    before = sorted(folder.parent.rglob("*"))
    with pytest.raises(AutodriveError, match="cannot be the name of a file"):
        ask(sim, SaveFile(name, replaces=True))
    assert sorted(folder.parent.rglob("*")) == before


def test_a_link_to_another_place_is_not_written(sim: Client, folder: Path) -> None:
    (folder / "link.yaml").symlink_to(folder.parent / "secret.yaml")
    with pytest.raises(AutodriveError, match=r"'link.yaml' is a link to another place"):
        ask(sim, SaveFile("link", replaces=True))
    assert "Secret" in (folder.parent / "secret.yaml").read_text()


def test_a_full_folder_takes_no_more_files(sim: Client, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("autodrive.run.own_files.MAX_FILES", 3)
    with pytest.raises(AutodriveError, match="the folder 'mine' has 3 files; at most 3 are possible"):
        ask(sim, SaveFile("more"))
    assert not (folder / "more.yaml").exists()


SCENARIO = "title: Sent\nmap: {map}\nvehicles:\n  V1: {{type: {type}{more}}}\n"


def sent(map_: str = "oval", type_: str = "nigel", more: str = "") -> str:
    return SCENARIO.format(map=map_, type=type_, more=more)


def test_the_text_of_a_scenario_is_loaded_without_edits_and_its_own_map_too(
    sim: Client, simulation: Simulation
) -> None:
    ask(sim, OpenFile("sent.yaml", sent()))
    assert simulation.world.spec.title == "Sent"
    sim.edit_map({"road": MapModule("curved_road", 9.0, 9.0)})
    text = ask(sim, SaveScenario())
    bounds = simulation.world.map.bounds
    ask(sim, OpenFile("plane.yaml", sent("plane")))
    assert simulation.world.map.bounds != bounds
    ask(sim, OpenFile("../../again.yaml", text))
    assert simulation.world.map.bounds == bounds
    ask(sim, OpenFile("track", "points: [0 0, 9 0, 9 6, 0 6]\nwidth: 1.0\n"))
    assert simulation.world.map.track is not None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (sent("/etc/passwd"), "map '/etc/passwd' does not belong to the simulator"),
        (sent("../secret.yaml"), "map '../secret.yaml' does not belong to the simulator"),
        (sent("../../scenario/data/maps/oval"), "does not belong to the simulator"),
        (sent(type_="./car.yaml"), "vehicle './car.yaml' does not belong to the simulator. Known: dart, f1tenth_mocap"),
        (sent(more=", own_sensors: {x: 'attack.py:Attack'}"), "sensors are Python files"),
        (
            sent("{title: x, placements: [{module: ../x.yaml, x: 0, y: 0}]}"),
            "module '../x.yaml' does not belong to the simulator",
        ),
        (sent() + "race: {rules: /etc/hosts.yaml}\n", "ruleset '/etc/hosts.yaml' does not belong to the simulator"),
        (sent() + "speed: 3\n", r"speed \(line 5\)"),
        (sent()[:-20], "invalid YAML|line"),
        ("vehicles: []", "vehicles"),
        ("", "is not in the folder"),
        ("just text", "expected 'key: value' lines"),
        ("title: x\nwheels: 4\n", r"wheels \(line 2\)"),
        (
            "placements:\n" + "- {module: straight_road, x: 0, y: 0}\n" * (MAX_PLACEMENTS + 1),
            rf"placements.*(at most )?{MAX_PLACEMENTS}",
        ),
        (
            "a: &a [x, x]\n" + "".join(f"{k}: [*a, *a]\n" for k in "bc") + "placements: &p [*p]\n",
            "inside its own anchor",
        ),
    ],
)
def test_a_foreign_text_is_refused_and_the_draft_stays(
    sim: Client, simulation: Simulation, text: str, message: str
) -> None:
    sim.edit_track(TRACK)
    before = simulation.world
    with pytest.raises(AutodriveError) as error:
        ask(sim, OpenFile("bad.yaml", text))
    assert re.search(message, str(error.value)), error.value
    assert simulation.world is before
    assert simulation.undo_name == "make a track"


def test_a_file_of_nearly_a_mebibyte_is_opened(sim: Client, simulation: Simulation) -> None:
    text = Track.load("fast").text()
    padded = text + "# " + "x" * 9000 + "\n"
    while len(padded) < 2**20 - 9100:
        padded += "# " + "x" * 9000 + "\n"
    ask(sim, OpenFile("fast.yaml", padded))
    assert simulation.world.map.track is not None


def test_without_a_folder_texts_are_opened_and_nothing_else(simulation: Simulation) -> None:
    with (
        SimulationServer(Served(simulation, scene_files, own_files=UserFiles(None)), PageOptions(port=0)) as server,
        Client(server.address) as sim,
    ):
        for operation in (ListFiles(), SaveFile("x"), OpenFile("x")):
            with pytest.raises(AutodriveError, match="autodrive run --folder FOLDER"):
                ask(sim, operation)
        ask(sim, OpenFile("sent", sent()))
        assert simulation.world.spec.title == "Sent"


def test_who_may_not_control_may_not_write(simulation: Simulation, folder: Path) -> None:
    """As the viewers of a race; and nobody is connected without the token, see test_access.py."""
    served = Served(simulation, scene_files, own_files=UserFiles(folder), refusal=lambda message: "a race is running")
    with (
        SimulationServer(served, PageOptions(port=0)) as server,
        Client(server.address) as sim,
        pytest.raises(AutodriveError, match="a race is running"),
    ):
        ask(sim, SaveFile("mine"))
    assert not (folder / "mine.yaml").exists()


def test_the_map_is_exported_for_map_server(server: SimulationServer, simulation: Simulation) -> None:
    with native_client(server) as it:
        answer = it.ask("ExportMap", name="town", resolution=0.02)
        assert "image: town.png" in answer["text"]
        assert (decode_png(answer["picture"])[..., 0] == occupancy(load_map("mini_map"), 0.02)).all()
        assert "choose a greater edge" in it.ask("ExportMap", resolution=0.001)["text"]
        it.ask("EditTrack", track={"points": TRACK.points})
        given = simulation.world.map.track
        answer = it.ask("ExportMap", name="mine", resolution=0.05)
        it.ask("ImportTrack", picture=answer["picture"], text=answer["text"])
        again = simulation.world.map.track
        assert given is not None and again is not None  # noqa: PT018
        assert again.length == pytest.approx(given.length, rel=0.02)


def test_a_draft_whose_walls_cross_is_exported(server: SimulationServer, simulation: Simulation) -> None:
    with native_client(server) as it:
        it.ask("EditTrack", track={"points": [[0.0, 0.0], [9.0, 6.0], [9.0, 0.0], [0.0, 6.0]]})
        answer = it.ask("ExportMap", resolution=0.05)
        assert {0, 254} < {*np.unique(decode_png(answer["picture"])).tolist()}
        it.ask("EditTrack", track={"points": [[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.0, 0.05]], "width": 1.0})
        assert it.ask("ExportMap", resolution=0.05)["type"] == "Response"
