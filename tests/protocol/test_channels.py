"""The registry of signals against the messages, a Frame of a world, the page and the documentation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

import autodrive
from autodrive.protocol.channels import CHANNELS, SIGNALS
from autodrive.protocol.messages import RaceState, RaceStatus, VehicleFrame
from autodrive.protocol.typescript import signal_tables
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.scenario.vehicles.spec import VehicleSpec, load_vehicle
from tests.support import signal_table
from tests.support.cars import car_file
from tests.support.tables import rewritten


@pytest.fixture(scope="module")
def spec_file(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A vehicle with all sensors."""
    return car_file(tmp_path_factory.mktemp("car"), {"sensors.range": {}, "sensors.lidar.rate": 100.0})


@pytest.fixture(scope="module")
def vehicle(spec_file: str) -> VehicleFrame:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=spec_file)}))
    race = RaceState(RaceStatus.RACING, 3, 12, 1.0, 8.0, 7.5, 15.5, 10.0, 1, 4, 50.0, 1, 0.0, False)
    return replace(world.step().vehicles["V1"], race=race)


def test_every_field_of_a_vehicle_frame_without_a_variable_number_of_readings_is_a_channel() -> None:
    fields = set(VehicleFrame.__struct_fields__) - {"cameras", "own", "v2x"}
    assert {channel.name for channel in CHANNELS} == fields
    assert all(signal.name.split(".")[0] == channel.name for channel in CHANNELS for signal in channel.signals)


def test_type_and_shape_of_every_signal_are_those_of_its_value(vehicle: VehicleFrame) -> None:
    for signal in SIGNALS:
        value = np.asarray(signal.read(vehicle))
        assert value.dtype == signal.dtype, signal.name
        if signal.size:
            assert value.ndim == 1, signal.name
        else:
            assert value.shape == signal.shape, signal.name
            assert len(signal.columns) == value.size, signal.name


def test_a_signal_without_a_reading_is_none(vehicle: VehicleFrame) -> None:
    bare = autodrive.make("plane").frame.vehicles["V1"]
    absent = {signal.name for signal in SIGNALS if signal.read(bare) is None}
    assert absent == {signal.name for signal in SIGNALS if signal.name.startswith(("range.", "race."))}
    assert absent == {signal.name for signal in SIGNALS if signal.is_optional}


def test_names_are_unique() -> None:
    for names in (
        [channel.name for channel in CHANNELS],
        [signal.name for signal in SIGNALS],
        [signal.hud.id for signal in SIGNALS if signal.hud],
        [plot.id for signal in SIGNALS for plot in signal.plots],
        [topic.name for channel in CHANNELS for topic in channel.topics],
    ):
        assert len(set(names)) == len(names)


def test_rates_are_fields_of_the_spec_of_a_vehicle(spec_file: str) -> None:
    spec: VehicleSpec = load_vehicle(spec_file)
    for channel in CHANNELS:
        place: Any = spec
        for name in channel.rate.split(".") if channel.rate else ():
            place = getattr(place, name)


def test_the_page_has_the_signals_of_the_registry() -> None:
    file = Path(__file__).parents[2] / "web" / "src" / "channels.ts"
    assert file.read_text(encoding="utf-8") == signal_tables(), "run scripts/generate-messages"


def test_the_table_of_the_documentation_is_that_of_the_registry() -> None:
    text = signal_table.DOCUMENT.read_text(encoding="utf-8")
    assert text == rewritten(text, {"signals": signal_table.rows()}), "run python -m tests.support.signal_table"
