"""The YAML examples of the documentation run."""

import math
import re
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import autodrive.devkit
from autodrive.base import jit
from autodrive.experiments.policies import Policy
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.camera.imperfections import PRESETS
from autodrive.protocol.messages import VehicleFrame
from autodrive.scenario import load_scenario
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.support.cars import car_file

DOCS = Path(__file__).parent.parent / "docs"


def examples(document: str) -> list[str]:
    return re.findall(r"```yaml\n(.*?)```", (DOCS / document).read_text(), flags=re.DOTALL)


def run(document: str, programs: int = 1) -> dict[str, Any]:
    """The names of the first Python programs of a document, after they have run."""
    names: dict[str, Any] = {}
    for program in re.findall(r"```python\n(.*?)```", (DOCS / document).read_text(), flags=re.DOTALL)[:programs]:
        exec(program, names)
    return names


def sensors(text: str) -> dict[str, Any]:
    """The sensors in a YAML text, as changes of a vehicle file."""
    return {f"sensors.{name}": spec for name, spec in yaml.safe_load(text).items()}


def test_scenario_of_the_document_runs(tmp_path: Path) -> None:
    file = tmp_path / "delivery.yaml"
    file.write_text(examples("scenarios.md")[1])
    assert load_scenario(file).seed == 7
    world = autodrive.make(file)
    frame = world.frame
    for _ in range(100):
        frame = world.step()
    assert set(frame.vehicles) == {"V1", "V2"}
    assert frame.objects["lid"].pose.position[2] == pytest.approx(0.15, abs=1e-3)  # soft contacts sink a little


def test_a_scenario_of_the_document_contains_its_map(tmp_path: Path) -> None:
    file = tmp_path / "street.yaml"
    file.write_text(examples("scenarios.md")[2])
    world = autodrive.make(file)
    assert [one.module.name for one in world.map.modules] == ["straight_road", "dead_end"]
    assert world.warnings == []


def test_the_scenario_made_in_python_is_like_that_of_the_file() -> None:
    names = run("scenarios.md")
    assert list(names["world"].frame.vehicles) == ["V1", "V2"]
    assert names["world"].frame.objects["crate"].pose.position[:2] == pytest.approx([0.5, 1.7])


def test_map_of_the_document_is_in_order(tmp_path: Path) -> None:
    file = tmp_path / "street.yaml"
    file.write_text(examples("scenarios.md")[0])
    map_ = load_map(file)
    assert len(map_.joins) == 4  # two joints, in both directions
    assert [box.mass for box in map_.boxes] == [0.5]


def test_lidar_of_the_document_fits_the_car(tmp_path: Path) -> None:
    lidar = load_vehicle(car_file(tmp_path, sensors(examples("scenarios.md")[3]))).sensors.lidar
    assert lidar is not None
    assert (lidar.rays, lidar.rate) == (1080, 40.0)


def test_the_range_sensor_of_the_document_fits_the_car(tmp_path: Path) -> None:
    sensor = load_vehicle(car_file(tmp_path, sensors(examples("scenarios.md")[4]))).sensors.range
    assert sensor is not None
    assert (sensor.range_max, sensor.rate) == (4.0, 20.0)


def test_cameras_of_the_document_fit_the_car(tmp_path: Path) -> None:
    cameras = load_vehicle(car_file(tmp_path, yaml.safe_load(examples("vehicle.md")[0]))).cameras
    assert cameras["front"].imperfections.exposure == -0.5
    assert cameras["rear"] == load_vehicle("nigel").cameras["rear"].model_copy(
        update={
            "imperfections": PRESETS["raspberry_pi_v1"],
            "focal_length": None,
            "sensor_size": None,
        }
    )


def test_drive_and_tyres_of_the_document_fit_the_race_cars(tmp_path: Path) -> None:
    drive, tyres = (yaml.safe_load(text) for text in examples("race_car.md"))
    drivetrain = load_vehicle(car_file(tmp_path, drive, "roboracer_physical")).drivetrain
    physical = load_vehicle("roboracer_physical").drivetrain
    assert drivetrain.differentials.rear.limits == (0.02, 0.5)
    assert drivetrain.model_copy(update={"differentials": physical.differentials}) == physical
    car = load_vehicle("roboracer_f1tenth")
    changed = load_vehicle(
        car_file(tmp_path, {f"wheels.{name}": one for name, one in tyres.items()}, "roboracer_f1tenth")
    )
    assert changed == car


def test_the_weather_of_the_document_is_that_of_the_world() -> None:
    names = run("weather.md")
    assert names["frame"].weather.rain == 0.6
    assert names["frame"].time_of_day == 66600.0


def test_the_policy_of_learning_to_race_is_faster(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    policy = run("learning_to_race.md")["policy"]
    assert Policy.load(tmp_path / "faster.npz").throttle[1] == pytest.approx(policy.throttle[1] / 0.9)


def test_the_drawings_of_the_document_are_drawn() -> None:
    drawings = run("drawing.md")["world"].drawings
    assert {name: (one.drawing.kind, one.until) for name, one in drawings.items() if one.drawing} == {
        "path": ("path", math.inf),
        "points": ("points", 0.5),
        "text": ("text", math.inf),
    }


def test_the_traffic_lights_of_the_document_are_set_and_follow_its_program(tmp_path: Path) -> None:
    assert run("traffic_lights.md")["frame"].traffic_lights["traffic_light_1"].mode == "set"
    (tmp_path / "town.yaml").write_text(examples("traffic_lights.md")[0])
    lights = autodrive.make(tmp_path / "town.yaml").frame.traffic_lights.values()
    # at 22 - 4 = 18 s of the cycle: the second phase has green from 11 s to 19 s, the first one again at 22 s
    assert [(one.state.name, one.time_to_change) for one in lights] == [("RED", 4.0), ("GREEN", 1.0)] * 2


def test_the_traffic_of_the_document_drives(tmp_path: Path) -> None:
    assert len(run("traffic.md")["others"]) == 12
    (tmp_path / "town.yaml").write_text(examples("traffic.md")[0])
    world = autodrive.make(tmp_path / "town.yaml")
    assert world.vehicle_names == ["V1", *(f"traffic_{k}" for k in range(1, 13))]


def test_the_radio_of_the_document_is_heard(tmp_path: Path) -> None:
    shown = run("v2x.md", 2)
    assert shown["car"].position[0] == pytest.approx(-2.5, abs=0.01)
    assert np.nanmean(shown["x"]) == pytest.approx(-2.5, abs=0.01)
    assert len(shown["time_to_change"]) == 100
    (tmp_path / "radio.yaml").write_text(examples("v2x.md")[0])
    spec = load_scenario(tmp_path / "radio.yaml").v2x
    assert spec is not None
    assert spec.model_dump() == {
        "range": 10.0,
        "rate": 10.0,
        "delay": 0.02,
        "jitter": 0.01,
        "loss": 0.1,
        "position_noise": 0.03,
    }


def test_scenario_and_tyres_in_the_document_on_weather_are_valid(tmp_path: Path) -> None:
    start, tyres = examples("weather.md")
    (tmp_path / "rainy.yaml").write_text(start)
    spec = load_scenario(tmp_path / "rainy.yaml")
    assert (spec.weather.rain, spec.weather.fog, spec.time_of_day) == (0.6, 0.2, 66600.0)
    car = load_vehicle(
        car_file(tmp_path, {f"wheels.{name}": one for name, one in yaml.safe_load(tyres)["wheels"].items()})
    )
    assert car.wheels.weather is not None
    assert car.wheels.weather.wet_grip == 0.75


def test_the_race_of_the_document_drives() -> None:
    names = run("race_car.md")
    car = names["frame"].vehicles["V1"]
    assert car.speed > 4.5
    assert len(car.lidar.ranges) == 1081


@pytest.mark.parametrize(
    ("fit", "vertical", "horizontal", "fx", "fy"),
    re.findall(
        r"\(`fit: (\w+)`\) \| \**([\d.]+)\** \| \**([\d.]+)\** \| ([\d.]+), ([\d.]+) \|",
        (DOCS / "vehicle.md").read_text(),
    ),
)
def test_table_of_pinholes_is_right(fit: str, vertical: str, horizontal: str, fx: str, fy: str) -> None:
    tree = load_vehicle("nigel").cameras["front"].model_dump() | {"fit": fit}
    k = CameraSpec.model_validate(tree).intrinsics
    assert (f"{k.fx:.2f}", f"{k.fy:.2f}") == (fx, fy)
    assert 2.0 * math.degrees(math.atan(240.0 / k.fy)) == pytest.approx(float(vertical), abs=0.0051)
    assert 2.0 * math.degrees(math.atan(320.0 / k.fx)) == pytest.approx(float(horizontal), abs=0.0051)


def test_the_programs_of_the_document_on_vehicles_run(gl: str) -> None:
    names = run("vehicle.md", 2)
    car = names["frame"].vehicles["V1"]
    assert car.velocity[0] == pytest.approx(0.3)
    assert car.steering == pytest.approx(0.2 * math.radians(30.0), rel=1e-6)  # 0.3 s of a lag of 20 ms
    assert names["image"].rgb.shape == (480, 640, 3)


def test_the_programs_of_the_python_library_do_what_they_say(gl: str, capsys: pytest.CaptureFixture[str]) -> None:
    names = run("python.md", 7)
    assert names["image"].rgb.shape == (480, 640, 3)
    car = names["world"].frame.vehicles["V1"]
    rows = re.findall(r"^\| (`.*`) \|", (DOCS / "python.md").read_text(encoding="utf-8"), re.MULTILINE)
    listed = {name for row in rows for name in re.findall(r"`([a-z_.0-9]+)`", row)}
    assert {name.partition(".")[0] for name in listed} >= {*VehicleFrame.__struct_fields__} - {"cameras", "is_traffic"}
    for name in listed - {"range.range"}:  # this car has no range sensor
        attrgetter(name)(car)
    right, ahead, left = names["ends"]
    assert right < ahead - 0.05 < ahead + 0.05 < left
    # the throttle rises from world to world, and the cars start towards x
    assert (np.diff(names["readings"].position[:, 0, 0]) > 0.0).all()
    assert np.isfinite(names["result"][1]).all()
    assert "200 ticks" in capsys.readouterr().out


def test_the_devkit_program_of_the_document_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[Any] = []
    monkeypatch.setattr(autodrive.devkit, "drive", lambda step, *things: given.extend((step, *things)))
    run("devkit_python.md")
    step, nigel = given
    nigel.parse_data({"V1 LIDAR Range Array": "0.2 3.0"})
    step()
    assert nigel.generate_commands() == {"V1 Throttle": "0.5", "V1 Steering": "0.2", "V1 Reset": "False"}


def test_the_devkit_document_names_what_a_vehicle_has() -> None:
    document = (DOCS / "devkit_python.md").read_text()
    names = {name for name in vars(autodrive.devkit.Nigel()) if not name.startswith("_")} - {"id"}
    assert not {name for name in names if f"`{name}`" not in document}


UNITS = "us|steps/s|times real time|ticks a second"
OTHER_FIGURES = {"scenarios.md": "the limits of a setting"}
"""Pages with figures of these units that say nothing of the speed of the simulator."""


def speeds(page: Path, units: str = UNITS) -> set[tuple[str, str]]:
    """Each figure of speed of a page with its unit."""
    text = " ".join(page.read_text(encoding="utf-8").split())
    number = r"\d[\d.,]*\d|\d"
    groups = re.findall(rf"((?:(?:{number})(?:, | to | and | / |; ))*(?:{number})) ({units})\b", text)
    return {(figure, unit) for figures, unit in groups for figure in re.findall(number, figures)}


def test_a_figure_of_speed_is_that_of_the_page_on_performance() -> None:
    root, performance = DOCS.parent, DOCS / "performance.md"
    pages = {root / "ARCHITECTURE.md", *DOCS.glob("*.md")} - {performance}
    quoted = {page.name: speeds(page) for page in pages if page.name not in OTHER_FIGURES}
    quoted["README.md"] = speeds(root / "README.md", f"{UNITS}|ms")
    assert ("23", "us") in quoted["README.md"] & quoted["tracks.md"]
    measured = speeds(performance, f"{UNITS}|ms")
    assert {name: figures - measured for name, figures in quoted.items() if figures - measured} == {}


FIRST_START = "10 s on a fast machine, two minutes on a slow one"


def test_the_duration_of_the_first_start_is_that_of_its_message() -> None:
    assert jit.DURATION == FIRST_START
    words = FIRST_START.replace(",", " and")
    for file in ("README.md", "docs/install.md", "examples/notebook/first_steps.ipynb"):
        assert words in " ".join((DOCS.parent / file).read_text(encoding="utf-8").split()), file


@pytest.mark.parametrize(
    ("place", "figure", "quotes"),
    [
        (
            "docs/performance.md",
            r"download of a default install \| (\d+) MB",
            {
                "scripts/setup": r"packages of the simulator \(about (\d+) MB",
                "docs/install.md": r"others, about (\d+) MB",
                "docs/comparison.md": r"about (\d+) MB of Python packages",
            },
        ),
        ("scripts/test", r"in about (\w+) minutes", {"README.md": r"--quick takes about (\w+) minutes"}),
        (
            "docs/performance.md",
            r"memory of each world after the first \| [\d.]+ / ([\d.]+) KiB",
            {"docs/batch.md": r"A world needs about (\d+) KiB"},
        ),
        ("docs/scaling_out.md", r"x ([\d.]+) MB a minute", {"docs/performance.md": r"% / ([\d.]+) MB a minute"}),
    ],
)
def test_a_figure_in_several_places_is_the_same(place: str, figure: str, quotes: dict[str, str]) -> None:
    def said(file: str, pattern: str) -> list[str]:
        return re.findall(pattern, (DOCS.parent / file).read_text(encoding="utf-8"))

    def rounded(value: str) -> str:
        return f"{float(value):.2g}" if value[0].isdigit() else value

    (value,) = said(place, figure)
    for file, pattern in quotes.items():
        assert [rounded(quote) for quote in said(file, pattern)] == [rounded(value)], file
