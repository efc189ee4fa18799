"""Attacks on the YAML files: each is loaded and runs, or is refused with a `SpecError` that names file and line.

AUTODRIVE_HARDENING=long mutates 12,500 files instead of some hundred.
"""

from __future__ import annotations

import math
import os
import random
import re
import time
from collections.abc import Callable, Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

import autodrive
from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec
from autodrive.base.yaml_files import MAX_BYTES, MAX_CHARACTERS, MAX_DEPTH, MAX_NODES, parse
from autodrive.cli.spec_files import SPECS, check
from autodrive.physics.sensors.camera.camera import MAX_PIXELS, CameraSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.scenario import MAX_BOXES, MAX_VEHICLES, BoxSpec, RaceSpec, ScenarioSpec, VehiclePlacement
from autodrive.scenario.kinds import Kind, find, names
from autodrive.scenario.maps.map import MAX_EXTENT, load_map
from autodrive.scenario.maps.module import ModuleSpec
from autodrive.scenario.maps.shapes import Rectangle
from autodrive.scenario.maps.solids import BlockSpec
from autodrive.scenario.maps.spec import MAX_PLACEMENTS, MAX_STATICS
from autodrive.scenario.vehicles.spec import RigidBodySpec, VehicleSpec, WheelSpec
from tests.support.cars import car_file
from tests.support.hardening import cases

DOCS = Path(__file__).parents[2] / "docs"
CPU_LIMIT = 10.0
"""Processor time for one file [s]. The worst file needs less than 2 s on an idle machine; processor time, too, grows
when other programs use the same caches. Without the limits of the loader, several attacks below need minutes."""

# -- attacks by hand -------------------------------------------------------------------------------------------


def many(count: int, entry: str) -> str:
    return "".join(f"  e{i}: {entry}\n" for i in range(count))


LEVELS = "\n".join(f"l{i}: &l{i} [{', '.join([f'*l{i - 1}'] * 9)}]" for i in range(1, 10))
TEXTS: dict[str, tuple[Kind, str, str]] = {
    "alias bomb": ("scenario", f"l0: &l0 [x, x]\n{LEVELS}\n", r"line 6\): a file must have at most 50000 keys"),
    "alias inside its anchor": ("scenario", "boxes: &b {a: *b}\n", r"line 1\): the alias '\*b' is inside"),
    "100,000 brackets": ("map", "title: " + "[" * 100_000, rf"line 1\): lists .* at most {MAX_DEPTH} deep"),
    "deep by aliases": (
        "map",
        "l0: &l0 [x]\n" + "".join(f"l{i}: &l{i} [*l{i - 1}]\n" for i in range(1, 50)),
        rf"line \d+\): lists .* at most {MAX_DEPTH} deep",
    ),
    "many nodes": ("map", f"title: [{'1, ' * (MAX_NODES + 1)}]", r"line 1\): a file must have at most"),
    "integer tag": ("scenario", "map: plane\nseed: !!int x\n", r"line 2\): tags such as 'tag:yaml.org,2002:int'"),
    "Python tag": ("scenario", "seed: !!python/object/apply:os.getpid []\n", r"line 1\): tags such as"),
    "5,000 digits": ("scenario", f"seed: {'9' * 5000}\n", r"line 1\): '9+\.\.\.' is not a number"),
    "300 digits": ("scenario", f"seed: {'9' * 100}\n", r"seed \(line 1\): must be"),
    "a large number": ("scenario", "vehicles: {V1: {x: 1.0e+300}}\n", r"vehicles\.V1\.x \(line 1\): must be at most"),
    "a short substep": ("scenario", "substep: 1.0e-15\n", r"substep \(line 1\): must be at least 1e-05"),
    "a huge word": ("map", f"title: {'x' * 20_000}\n", r"line 1\): a key or value must have at most"),
    "a merge of a number": ("map", "title: a\n<<: 5\n", r"line 2\): .*mapping"),
    "5,000 vehicles": ("scenario", f"vehicles:\n{many(5000, '{}')}", r"vehicles \(line 1\): must have at most 100"),
    "6,000 boxes": ("scenario", f"boxes:\n{many(6000, '{x: 1, y: 1}')}", r"boxes \(line 1\): must have at most 1000"),
    "9,000 unknown keys": ("scenario", f"map: plane\n{many(9000, '1')}".replace("\n  ", "\n"), "and 8900 more errors"),
    "9,000 faulty vehicles": ("scenario", f"vehicles:\n{many(9000, '{x: far}')}", r"vehicles\.e0\.x \(line 2\)"),
    "1,000 boxes at one place": (
        "scenario",
        f"boxes:\n{many(1000, '{x: 1, y: 1}')}",
        r"boxes \(line 1\): MuJoCo cannot simulate",
    ),
    "100 vehicles at one place": (
        "scenario",
        f"vehicles:\n{many(100, '{}')}",
        r"vehicles.* \(line \d+\): (MuJoCo cannot simulate|'e\d+' and 'e\d+' overlap)",
    ),
    "a vehicle named world": ("scenario", "vehicles: {world: {}}\n", r"vehicles\.world \(line 1\): .*ground or world"),
    "a box named world": ("scenario", "boxes: {world: {x: 1, y: 0}}\n", r"boxes\.world \(line 1\): .*ground or world"),
    "a flat box": ("scenario", "boxes: {a: {x: 1, y: 0, size: [1, 1, -1]}}\n", r"boxes\.a\.size 3 \(line 1\)"),
    "a sector of 1e300 m": (
        "map",
        "title: a\npaved:\n  - {shape: sector, outer_radius: 1.0e+300, start_deg: 0, end_deg: 9}\n",
        r"paved 1\.sector\.outer_radius \(line 3\): must be at most 1000",
    ),
    "a million dashes": (
        "map",
        "title: a\npaved:\n  - {shape: line, points: [[0, 0], [1000, 0]], width: 1, dash: 0.001, gap: 0.001}\n",
        r"paved \(line 2\): these shapes have 2000004 corners",
    ),
    "a block named ground": (
        "map",
        "title: a\nblocks:\n  - {name: ground, x: 1, y: 1, length: 1, width: 1, height: 1}\n",
        r"block 1 \(line 3\): the name 'ground' is reserved",
    ),
    "a block far from the map": (
        "map",
        "title: a\nwalls:\n  - {points: [[0, 0], [1, 0], [1, 1]], height: 1}\nblocks:\n"
        "  - {x: -9000, y: 0, length: 1, width: 1, height: 1}\n  - {x: 0, y: 0, length: 1, width: 1, height: 1}\n",
        r"block 1 \(line 5\): the map is 9002 m x ",
    ),
    "a lane that is almost straight": (
        "module",
        "title: a\ntype: road\nlength: 1\nwidth: 1\nports:\n"
        "  a: {x: -9000, y: 0, yaw_deg: 180, width: 0.2, is_blind: true}\n"
        "  b: {x: 9000, y: 1.35e-05, yaw_deg: 8.6e-08, width: 0.2, is_blind: true}\n"
        "lanes: [[a, b]]\n",
        r"lane 1 \(line 8\): lane from 'a' to 'b': the arc between the two poses has a radius of",
    ),
}  # fmt: skip


def refused(kind: Kind, path: Path) -> str:
    """The text of the error, which names the file."""
    start = time.process_time()
    with pytest.raises(SpecError) as caught:
        check(str(path), kind)
    assert time.process_time() - start < CPU_LIMIT
    assert path.name in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("attack", TEXTS)
def test_a_hostile_text_is_refused_with_its_line(attack: str, tmp_path: Path) -> None:
    kind, text, expected = TEXTS[attack]
    path = tmp_path / "hostile.yaml"
    path.write_text(text)
    message = refused(kind, path)
    assert re.search(expected, message), message
    assert len(message) < 100_000


@pytest.mark.parametrize(
    "read",
    [
        lambda text: parse(text, VehicleSpec),
        lambda text: find("vehicle", text),
        lambda text: find("scenario", text),
        load_map,
    ],
)
def test_a_text_of_60_megabytes_is_refused_at_once(read: Callable[[str], object]) -> None:
    """Also where a name is expected."""
    text = find("vehicle", "nigel").read_text() + 60_000_000 * "#"
    start = time.process_time()
    with pytest.raises(SpecError) as caught:
        read(text)
    assert time.process_time() - start < 1.0  # without a limit 2 to 15 s
    assert len(str(caught.value)) < 2000


CARS: dict[str, tuple[dict[str, Any], str]] = {
    "an impossible inertia": ({"body.inertia": [0.01, 0.01, 0.03]}, r"body \(line \d+\): inertia .* is impossible"),
    "a negative inertia": ({"body.inertia": [-1.0, 1.0, 1.0]}, r"body\.inertia 1 \(line \d+\): must be at least"),
    "a negative size": (
        {"lidar_collider.size": [0.1, -0.1, 0.1]},
        r"lidar_collider\.size 2 \(line \d+\): must be at least 0.001",
    ),
    "wheels that sink into themselves": (
        {"wheels.suspension.distance": 0.1},
        r"wheels \(line \d+\): the suspension can be compressed by 0.05 m",
    ),
    "a chassis in the ground": (
        {"lidar_collider.position": [0.1, 0.0, -0.1]},
        r"lidar_collider \(line \d+\): reaches below the ground",
    ),
    "a centre of mass outside": (
        {"body.center_of_mass": [1.0, 0.0, 0.0]},
        r"body\.center_of_mass \(line \d+\): must be between the wheels",
    ),
    "a camera named like a sensor": (
        {"cameras": {"imu": {"mount": {}, "width": 9, "height": 9, "field_of_view_deg": 60}}},
        r"cameras \(line \d+\): 'imu' is a sensor",
    ),
    "a billion rays": ({"sensors.lidar.rays": 10**9}, r"sensors\.lidar\.rays \(line \d+\): must be at most 10000"),
    "a large image": ({"cameras.front.width": 8192, "cameras.front.height": 8192}, "more than 16777216 pixels"),
    "a colour beyond white": (
        {"lights.tail.color": [2.0, 0.0, 0.0]},
        r"lights\.tail\.color 1 \(line \d+\): must be at most 1",
    ),
}


@pytest.mark.parametrize("attack", CARS)
def test_an_impossible_vehicle_is_refused_with_its_line(attack: str, tmp_path: Path) -> None:
    changes, expected = CARS[attack]
    message = refused("vehicle", Path(car_file(tmp_path, changes)))
    assert re.search(expected, message), message


def test_a_realistic_lens_that_does_not_cover_a_wide_image_is_refused(tmp_path: Path) -> None:
    """Each way out that the message names works."""
    path = tmp_path / "wide.yaml"

    def write(changes: dict[str, Any]) -> None:
        car = car_file(tmp_path, {"cameras.front.field_of_view_deg": 70.0, **changes})
        path.write_text(f"vehicles: {{V1: {{type: {car}, has_realistic_sensors: true}}}}\n")

    write({})
    message = refused("scenario", path)
    assert "front: with noise 'realistic', camera: this distortion is too strong" in message
    (widest,) = re.findall(r"field_of_view_deg of at most ([\d.]+)", message)
    write({"cameras.front.field_of_view_deg": float(widest)})
    check(str(path), "scenario")
    write({"cameras.front.field_of_view_deg": float(widest) + 0.3})
    refused("scenario", path)
    assert "'hardware: rectified'" in message
    write({"cameras.front.hardware": "rectified"})
    check(str(path), "scenario")


def test_an_impossible_date_is_a_text() -> None:
    assert parse("title: 2001-13-45\n", ScenarioSpec).title == "2001-13-45"


def test_anchors_aliases_and_merges_of_a_plain_file_work(tmp_path: Path) -> None:
    path = tmp_path / "merged.yaml"
    path.write_text("vehicles:\n  V1: &car {type: nigel, x: 1.0}\n  V2: {<<: *car, x: 2.0}\n  V3: {<<: *car, y: 3}\n")
    vehicles = autodrive.make(path).spec.vehicles
    assert [(car.x, car.y) for car in vehicles.values()] == [(1.0, 0.0), (2.0, 0.0), (1.0, 3.0)]


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"title: a\nnote: \xff\n", "line 2: a file must be text in UTF-8; it has the byte 0xff"),
        ("title: a\n".encode("utf-16"), "line 1: a file must be text in UTF-8"),
        (b"#" * (MAX_BYTES + 1), "a file must have at most 1 MiB"),
    ],
)
def test_a_binary_file_is_refused(data: bytes, expected: str, tmp_path: Path) -> None:
    path = tmp_path / "binary.yaml"
    path.write_bytes(data)
    for kind in SPECS:
        assert expected in refused(kind, path)


@pytest.mark.parametrize("reference", ["folder.yaml", "device.yaml", "pipe.yaml", f"{'x' * 300}.yaml", "y" * 9000])
def test_a_reference_to_what_is_no_file_is_refused(
    reference: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("folder.yaml").mkdir()
    Path("device.yaml").symlink_to("/dev/zero")
    os.mkfifo("pipe.yaml")
    Path("scenario.yaml").write_text(f"map: {reference}\nvehicles:\n  V1: {{type: {reference}}}\n")
    message = refused("scenario", Path("scenario.yaml"))
    assert re.search(r"map \(line 1\): .*(is not a file|does not exist|is not known)", message)
    assert re.search(r"vehicles\.V1\.type \(line 3\): .*(is not a file|does not exist|is not known)", message)
    Path("map.yaml").write_text(f"title: a\nplacements:\n  - {{module: {reference}, x: 0, y: 0}}\n")
    assert re.search(r"\(line 3\): .*(is not a file|does not exist|is not known)", refused("map", Path("map.yaml")))


@pytest.mark.parametrize("points", ["[[1, 0], [2, 0]]", "[[1, 0], [2, 0], [1, 0]]", "[[0, 0], [2, 2], [2, 0], [0, 2]]"])
def test_a_closed_wall_that_encloses_nothing_is_only_a_wall(points: str, tmp_path: Path) -> None:
    path = tmp_path / "fence.yaml"
    path.write_text(f"title: a\nwalls: [{{points: {points}, is_closed: true, height: 1}}]\n")
    assert load_map(path).enclosure is None


def test_rules_for_several_keys_name_the_line() -> None:
    with pytest.raises(SpecError) as caught:
        parse(
            "title: a\ntype: obstruction\nlength: 1\nwidth: 1\nports:\n  a: {x: 0, y: 0, yaw_deg: 0, width: 1}\n"
            "lanes:\n  - [a, b]\nstop_lines:\n  - {port: c, distance: 0, width: 1}\n",
            ModuleSpec,
        )
    assert [error.partition(":")[0] for error in caught.value.errors] == [
        "lane 1 (line 8)", "stop_line 1 (line 10)", "ports.a (line 6)", "type (line 2)"
    ]  # fmt: skip
    with pytest.raises(SpecError, match=r"substep \(line 2\): tick 0\.01 s must be a whole number"):
        parse("map: plane\nsubstep: 0.003\n", ScenarioSpec)


def test_the_largest_scenario_loads() -> None:
    vehicles = {f"V{i}": VehiclePlacement(x=i % 10, y=i // 10) for i in range(MAX_VEHICLES)}
    boxes = {f"b{i}": BoxSpec(x=-1.0 - 0.2 * (i % 25), y=0.2 * (i // 25)) for i in range(MAX_BOXES)}
    autodrive.make("plane").step()  # compiles
    start = time.process_time()
    frame = autodrive.make(ScenarioSpec(vehicles=vehicles, boxes=boxes)).step()
    assert time.process_time() - start < CPU_LIMIT  # 2 s on an idle machine
    assert (len(frame.vehicles), len(frame.objects)) == (MAX_VEHICLES, MAX_BOXES)


def bounds(spec: type[Spec], field: str) -> dict[str, float]:
    """Lower and upper bound of a field, as in the JSON schema of the Spec."""
    schema = spec.model_json_schema()["properties"][field]
    return {key: schema[key] for key in ("minimum", "maximum", "maxItems", "maxProperties") if key in schema}


def test_the_documentation_has_the_limits_of_the_code() -> None:
    rows = dict(re.findall(r"^\| ([^|]+) \| ([^|]+) \|$", (DOCS / "scenarios.md").read_text(), re.MULTILINE))
    assert rows["file"].startswith(f"{MAX_BYTES // 2**20} MiB")
    nodes = f"{MAX_NODES:,}, each at most {MAX_CHARACTERS:,} characters, at most {MAX_DEPTH} lists"
    assert rows["keys and values of a file"].startswith(nodes)
    assert rows["vehicles"] == f"{MAX_VEHICLES:,}"
    assert rows["boxes, with those of the map"] == f"{MAX_BOXES:,}"
    assert rows["modules of a map"] == f"{MAX_PLACEMENTS:,}"
    assert rows["points of walls, blocks, and parts of signs and traffic lights (two each)"] == f"{MAX_STATICS:,}"
    assert rows["map"] == f"{MAX_EXTENT:,.0f} m x {MAX_EXTENT:,.0f} m"
    assert rows["position"] == "10,000 m from the origin; in a vehicle 100 m"
    assert bounds(BoxSpec, "x") == {"minimum": -1e4, "maximum": 1e4}
    assert bounds(WheelSpec, "force_height") == {"minimum": -100.0, "maximum": 100.0}
    assert rows["lengths of boxes, walls, blocks and vehicles"] == "1 mm to 100 m"
    assert bounds(BlockSpec, "length") == bounds(WheelSpec, "radius") == {"minimum": 0.001, "maximum": 100.0}
    assert rows["lengths of roads and of paint"] == "1 mm to 1,000 m"
    assert bounds(Rectangle, "length") == {"minimum": 0.001, "maximum": 1000.0}
    assert rows["mass"] == "box: 1 g to 10,000 kg; vehicle: 10 g to 1,000 kg"
    assert bounds(BoxSpec, "mass") == {"minimum": 0.001, "maximum": 10_000.0}
    assert bounds(RigidBodySpec, "mass") == {"minimum": 0.01, "maximum": 1000.0}
    assert rows["tick, substep"] == "10 us to 100 ms, 10 us to 5 ms"
    assert bounds(ScenarioSpec, "tick") == {"minimum": 1e-5, "maximum": 0.1}
    assert bounds(ScenarioSpec, "substep") == {"minimum": 1e-5, "maximum": 0.005}
    assert rows["rate of a sensor"] == "0.001 Hz to 10,000 Hz"
    assert bounds(LidarSpec, "rate") == {"minimum": 0.001, "maximum": 10_000.0}
    assert rows["LIDAR"] == f"{bounds(LidarSpec, 'rays')['maximum']:,} rays"
    assert rows["image"] == f"{bounds(CameraSpec, 'width')['maximum']:,} pixels along each edge, {MAX_PIXELS:,} in all"


# -- mutated files ---------------------------------------------------------------------------------------------

HOSTILE = (None, True, "text", "", [], {}, [[0, 0], [0, 0]], {1: 2}, -1, 0, 1e-9, 1e300, math.inf, math.nan, 2**63)
HOSTILE += ("world", "nigel", "/dev/zero.yaml", "../x.yaml", "\0", "\U0001f600", "2001-13-45", "x" * 3000)

Place = tuple[Any, Any]
"""A list or mapping, and an index or key of it."""


def places(tree: Any) -> Iterator[Place]:
    """All places of a tree, each inner one after its outer one."""
    for key in list(tree) if isinstance(tree, dict) else range(len(tree)):
        yield tree, key
        if isinstance(tree[key], dict | list):
            yield from places(tree[key])


def mutated(tree: Any, rng: random.Random) -> str:
    """The text of a tree in which values are replaced, scaled, removed or repeated."""
    tree = deepcopy(tree)
    for _ in range(rng.choice([1, 1, 2, 3])):
        if not (choices := list(places(tree))):
            break
        parent, key = rng.choice(choices)
        match rng.randrange(4):
            case 0:
                del parent[key]
            case 1 if isinstance(parent[key], int | float):
                parent[key] *= rng.choice([-1, 0, 1e-6, 0.1, 1.001, 10, 1e6, 1e12])
            case 2 if isinstance(parent, list):
                parent[key:key] = [parent[key]] * rng.choice([1, 30, 3000])
            case _:
                parent[key] = rng.choice(HOSTILE)
    return yaml.dump(tree, Dumper=yaml.CSafeDumper, sort_keys=False)


def make_with(kind: Kind, path: Path) -> None:
    """Compile a scenario that uses that file."""
    match kind:
        case "scenario":
            autodrive.make(path)
        case "vehicle":
            autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=str(path))}))
        case "ruleset":
            cars = {"V1": VehiclePlacement(type="roboracer")}
            autodrive.make(ScenarioSpec(map="practice", race=RaceSpec(rules=str(path)), vehicles=cars))
        case "map":
            load_map(path)


WITH_ITS_PLACE = (
    r"line \d",
    r"^(map '\w+': )?\w+: is required$",  # a key of the file itself, which the file does not have
    r"^(map '\w+': )?and \d+ more (errors|overlaps)",
    r"the springs and dampers of '.*\.yaml' are unstable with a substep",  # of a scenario made in Python
)


@pytest.mark.parametrize("kind", SPECS)
def test_a_mutated_file_runs_or_is_refused_with_its_place(kind: Kind, tmp_path: Path) -> None:
    trees = [yaml.load(find(kind, name).read_text(), yaml.CSafeLoader) for name in names(kind)]
    rng, wrong, refusals, count = random.Random(f"{kind} file"), list[str](), 0, cases(40, 2500)
    for number in range(count):
        path = tmp_path / f"f{number}.yaml"  # a new name, because modules are cached by name and time
        path.write_text(mutated(rng.choice(trees), rng))
        start = time.process_time()
        try:
            check(str(path), kind)
            make_with(kind, path)
        except SpecError as error:
            refusals += 1
            wrong += [] if path.name in str(error) else [str(error)]
            wrong += [text for text in error.errors if not any(re.search(allowed, text) for allowed in WITH_ITS_PLACE)]
        assert time.process_time() - start < CPU_LIMIT
    assert wrong == []
    assert 0 < refusals < count
