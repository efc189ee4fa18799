"""What the devkit's vehicles read is what the simulator told, and what they say is what it hears."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from autodrive.devkit import F1TENTH, Nigel, TrafficLight, Vehicle
from autodrive.protocol.devkit import PROFILES, read_orders, recognise, telemetry
from autodrive.protocol.messages import Command, Headlights, Indicators
from tests.protocol.devkit_frames import frame, scan, vehicle

RECORDED = Path(__file__).parents[1] / "protocol" / "data" / "devkit_2023.json"


@pytest.fixture
def recorded() -> dict[str, str]:
    """A message of the original simulator of 2023."""
    return json.loads(RECORDED.read_text(encoding="utf-8"))["telemetry"]


def test_a_message_of_the_original_simulator_is_read(recorded: dict[str, str]) -> None:
    nigel, light = Nigel("V1"), TrafficLight("TL1")
    nigel.parse_data(recorded)
    light.parse_data(recorded)
    assert light.state == 0
    assert nigel.throttle == 0.0
    assert nigel.position is not None
    assert nigel.position.tolist() == [-1.1, 0.15, 0.033]
    assert nigel.orientation_quaternion is not None
    assert nigel.orientation_quaternion.tolist() == [0.0, 0.0, 0.005, 1.0]
    assert nigel.encoder_ticks is not None
    assert nigel.encoder_ticks.dtype == np.int64
    assert nigel.lidar_range_array is not None
    assert nigel.lidar_range_array[:3].tolist() == [np.inf, 1.008726, 1.01745]
    assert len(nigel.lidar_range_array) == 360


@pytest.mark.parametrize("year", ["2020", "2022", "2023", "2025"])
def test_every_era_of_our_simulator_is_read(year: str) -> None:
    picture = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    jpeg = simplejpeg.encode_jpeg(picture, quality=95, colorspace="RGB")
    ranges = np.linspace(0.2, 3.0, 360)
    told = frame(vehicle(lidar=scan(np.roll(ranges, 180))))  # that scan begins straight behind
    data = telemetry(told, PROFILES[year], images={("red", "front"): jpeg})
    nigel = Nigel("" if year == "2020" else "V1")
    nigel.parse_data(data)
    assert nigel.lidar_range_array == pytest.approx(ranges, rel=1e-6)
    assert nigel.front_camera_image is not None
    assert nigel.front_camera_image.shape == (48, 64, 3)
    assert np.abs(nigel.front_camera_image.astype(int) - (50, 100, 200)).max() < 8  # blue first
    assert (nigel.speed is None) == (year != "2025")


def test_what_was_never_told_is_none_and_what_is_missing_keeps_its_value(recorded: dict[str, str]) -> None:
    nigel = Nigel("V1")
    assert (nigel.throttle, nigel.position, nigel.front_camera_image) == (None, None, None)
    nigel.parse_data(recorded)
    nigel.parse_data({"V1 Throttle": 0.5})
    assert nigel.throttle == 0.5
    assert nigel.position is not None


def test_no_scan_yet_is_an_empty_array() -> None:
    nigel = Nigel("V1")
    nigel.parse_data({"V1 LIDAR Range Array": ""})
    assert nigel.lidar_range_array is not None
    assert nigel.lidar_range_array.shape == (0,)


def test_a_picture_is_decoded_once_and_only_if_looked_at() -> None:
    nigel = Nigel("V1")
    nigel.parse_data({"V1 Front Camera Image": base64.b64encode(b"no picture").decode()})
    with pytest.raises(ValueError, match="JPEG"):
        _ = nigel.front_camera_image
    jpeg = simplejpeg.encode_jpeg(np.zeros((8, 8, 3), np.uint8))
    nigel.parse_data({"V1 Front Camera Image": base64.b64encode(jpeg).decode()})
    assert nigel.front_camera_image is nigel.front_camera_image


def test_the_simulator_hears_what_is_commanded() -> None:
    nigel = Nigel("V1")
    nigel.throttle_command, nigel.steering_command = 0.5, -0.25
    nigel.headlights_command, nigel.indicators_command = 2, 3
    said = nigel.generate_commands()
    profile = recognise(said)
    assert profile is PROFILES["2023"]
    orders = read_orders(said, profile, {"V1": Command()})
    assert orders.commands["V1"] == Command(0.5, 0.25, Headlights.HIGH, Indicators.HAZARD)  # right-positive then


def test_a_left_positive_vehicle_is_a_script_of_2025() -> None:
    car = F1TENTH("V1", is_left_positive=True)
    car.throttle_command, car.steering_command = 1, 0.5
    said = car.generate_commands()
    assert said == {"V1 Throttle": "1", "V1 Steering": "0.5", "V1 Reset": "False"}
    profile = recognise(said)
    assert profile is PROFILES["2025"]
    assert read_orders(said, profile, {"V1": Command()}).commands["V1"].steering == 0.5


def test_what_was_never_commanded_is_not_said() -> None:
    assert Nigel("V1").generate_commands() == {}
    assert TrafficLight("TL1").generate_commands() == {}


def test_a_traffic_light_is_commanded_by_its_state() -> None:
    light = TrafficLight("TL3")
    light.command = 2
    assert read_orders(light.generate_commands(), PROFILES["2023"], {}).traffic_lights == {3: 2}


def test_verbose_prints_everything(capsys: pytest.CaptureFixture[str], recorded: dict[str, str]) -> None:
    nigel = Nigel("V1")
    nigel.parse_data(recorded, verbose=True)
    nigel.generate_commands(verbose=True)
    said = capsys.readouterr().out
    assert "position" in said
    assert "steering command" in said


def test_a_vehicle_of_2022_is_there_too() -> None:
    car = Vehicle()
    car.id = "V2"
    car.throttle_command = 1
    assert car.generate_commands() == {"V2 Throttle": "1"}
