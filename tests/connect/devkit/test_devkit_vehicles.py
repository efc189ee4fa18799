"""Vehicles of the devkit: they read the telemetry of the simulator, and the simulator reads their commands."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path

import numpy as np
import pytest
import simplejpeg

from autodrive.connect.devkit import F1TENTH, Nigel, RoboRacer, TrafficLight, Vehicle
from autodrive.protocol.devkit import read_commands, telemetry
from autodrive.protocol.devkit_profile import PROFILES, detect_profile
from autodrive.protocol.messages import Command, Headlights, Hold, Indicators
from tests.protocol.devkit_frames import frame, scan, vehicle

RECORDED = Path(__file__).parents[2] / "protocol" / "data" / "devkit_2023.json"


@pytest.fixture
def recorded() -> dict[str, str]:
    """A message of the original simulator of 2023."""
    return json.loads(RECORDED.read_text(encoding="utf-8"))["telemetry"]


def test_a_message_of_the_original_simulator_is_read(recorded: dict[str, str]) -> None:
    nigel, light = Nigel("V1"), TrafficLight("TL1")
    nigel.parse_data(recorded)
    light.parse_data(recorded)
    assert (light.state, nigel.throttle) == (0, 0.0)
    assert nigel.position.tolist() == [-1.1, 0.15, 0.033]
    assert nigel.orientation_quaternion.tolist() == [0.0, 0.0, 0.005, 1.0]
    assert nigel.encoder_ticks.dtype == np.int64
    assert nigel.lidar_range_array[:3].tolist() == [np.inf, 1.008726, 1.01745]
    assert len(nigel.lidar_range_array) == 360


@pytest.mark.parametrize("year", ["2020", "2022", "2023", "2025"])
def test_telemetry_of_each_devkit_generation_is_read(year: str) -> None:
    image = np.full((48, 64, 3), (200, 100, 50), np.uint8)
    jpeg = simplejpeg.encode_jpeg(image, quality=95, colorspace="RGB")
    ranges = np.linspace(0.2, 3.0, 360)
    sent = frame(vehicle(lidar=scan(np.roll(ranges, 180).tolist())))  # this scan starts straight behind the vehicle
    data = telemetry(sent, PROFILES[year], images={("red", "front"): jpeg})
    nigel = Nigel("" if year == "2020" else "V1")
    nigel.parse_data(data)
    assert nigel.lidar_range_array == pytest.approx(ranges, rel=1e-6)
    assert nigel.front_camera_image.shape == (48, 64, 3)
    assert np.abs(nigel.front_camera_image.astype(int) - (50, 100, 200)).max() < 8  # blue first
    assert (nigel.speed is None) == (year != "2025")


def test_values_are_none_before_the_first_message_and_kept_if_a_message_omits_them(recorded: dict[str, str]) -> None:
    nigel = Nigel("V1")
    assert (nigel.throttle, nigel.position, nigel.front_camera_image) == (None, None, None)
    nigel.parse_data(recorded)
    nigel.parse_data({"V1 Throttle": 0.5})
    assert nigel.throttle == 0.5
    assert nigel.position is not None


def test_before_the_first_scan_ranges_are_an_empty_array() -> None:
    nigel = Nigel("V1")
    nigel.parse_data({"V1 LIDAR Range Array": ""})
    assert nigel.lidar_range_array.shape == (0,)


def test_an_image_is_decoded_once_on_first_access() -> None:
    nigel = Nigel("V1")
    nigel.parse_data({"V1 Front Camera Image": base64.b64encode(b"no image").decode()})
    with pytest.raises(ValueError, match="JPEG"):
        _ = nigel.front_camera_image
    jpeg = simplejpeg.encode_jpeg(np.zeros((8, 8, 3), np.uint8))
    nigel.parse_data({"V1 Front Camera Image": base64.b64encode(jpeg).decode()})
    assert nigel.front_camera_image is nigel.front_camera_image


def test_the_simulator_reads_the_commands() -> None:
    nigel = Nigel("V1")
    nigel.throttle_command, nigel.steering_command = 0.5, -0.25
    nigel.headlights_command, nigel.indicators_command = 2, 3
    message = nigel.generate_commands()
    profile = detect_profile(message)
    assert profile
    assert (profile.name, profile.command_sign) == ("2023", -1.0)
    received = read_commands(message, profile, {"V1": Command()})
    assert received.commands["V1"] == Command(0.5, 0.25, Headlights.HIGH, Indicators.HAZARD)  # right-positive


def test_a_left_positive_vehicle_is_a_script_of_2025() -> None:
    car = F1TENTH("V1", is_left_positive=True)
    car.throttle_command, car.steering_command = 1, 0.5
    message = car.generate_commands()
    assert message == {"V1 Throttle": "1", "V1 Steering": "0.5", "V1 Reset": "False"}
    profile = PROFILES["2025"]
    assert detect_profile(message) is profile
    assert read_commands(message, profile, {"V1": Command()}).commands["V1"].steering == 0.5


def test_the_racing_car_reads_the_telemetry_of_the_league_and_is_driven_by_its_profile() -> None:
    sent = frame(vehicle(velocity=np.array([2.0, -0.1, 0.0]), collision_count=3))
    car = RoboRacer("V1")
    car.parse_data(telemetry(sent, PROFILES["roboracer"]))
    assert car.linear_velocity.tolist() == [2.0, -0.1, 0.0]
    assert (car.lap_count, car.lap_time, car.best_lap_time, car.collision_count) == (0, 0.0, math.inf, 3)
    assert car.rear_camera_image is None
    car.steering_command, car.cosim_mode = 0.5, 1
    car.posX_command, car.posY_command, car.posZ_command = 1.0, 2.0, 0.1
    car.rotX_command = car.rotY_command = car.rotZ_command = 0.0
    car.rotW_command = 1.0
    received = read_commands(car.generate_commands(), PROFILES["roboracer"], {"red": Command()})
    assert received.commands["red"].steering == 0.5  # left
    assert received.holds == {"red": Hold("red", (1.0, 2.0, 0.1))}
    assert received.resets == {"red": False}


def test_unset_commands_are_omitted_and_a_traffic_light_is_commanded_by_its_state() -> None:
    light = TrafficLight("TL3")
    assert Nigel("V1").generate_commands() == light.generate_commands() == {}
    light.command = 2
    assert read_commands(light.generate_commands(), PROFILES["2023"], {}).traffic_lights == {3: 2}


def test_verbose_prints_everything(capsys: pytest.CaptureFixture[str], recorded: dict[str, str]) -> None:
    nigel = Nigel("V1")
    nigel.parse_data(recorded, verbose=True)
    nigel.generate_commands(verbose=True)
    message = capsys.readouterr().out
    assert "position" in message
    assert "steering command" in message


def test_the_vehicle_class_of_2022_exists() -> None:
    car = Vehicle()
    car.id = "V2"
    car.throttle_command = 1
    assert car.generate_commands() == {"V2 Throttle": "1"}
