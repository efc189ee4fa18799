"""The devkit protocol against recorded messages, the measured table of signs, and random messages of a script."""

from __future__ import annotations

import base64
import gzip
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
import simplejpeg
from hypothesis import given
from hypothesis import strategies as st

from autodrive.base.errors import AutodriveError, SpecError
from autodrive.protocol import devkit
from autodrive.protocol.devkit import ENVIRONMENT, initial_telemetry, read_commands, telemetry
from autodrive.protocol.devkit_profile import PROFILES, DevkitSettings, Profile, detect_profile, is_ambiguous
from autodrive.protocol.messages import Command, Headlights, Hold, Indicators, RaceState, RaceStatus
from autodrive.scenario.kinds import find
from autodrive.scenario.vehicles.spec import load_vehicle
from tests.protocol.devkit_frames import frame, scan, vehicle

RECORDED = json.loads((Path(__file__).parent / "data" / "devkit_2023.json").read_text())
"""One telemetry and one command, recorded between a simulator stand-in and a running devkit; pictures cut short."""

LEFT, RIGHT = 1, -1
SIGNS = {"2020": (RIGHT, RIGHT), "2022": (RIGHT, RIGHT), "2023": (LEFT, LEFT), "2025": (LEFT, LEFT)}
SIGNS["roboracer"] = (LEFT, LEFT)
"""Where a positive command and a positive feedback point, by the teleoperation, the navigation and the wheel frames of
the ROS packages of each year."""


def shape_of(text: str) -> str:
    """The number format of a text: each run of digits before the point is one sign, each digit after it stands."""
    return re.sub(r"\d+(?=\.|\s|$)", "N", re.sub(r"(?<=\.)\d+", lambda m: "d" * len(m[0]), text.replace("-", "")))


@pytest.mark.parametrize("year", ["2022", "2023"])
def test_telemetry_has_the_recorded_keys_in_the_recorded_order_and_number_formats(year: str) -> None:
    ours = telemetry(frame(), PROFILES[year])
    assert list(ours) == list(RECORDED["telemetry"])
    fixed = [key for key in ours if "Array" not in key and "Image" not in key]
    assert {key: shape_of(ours[key]) for key in fixed} == {key: shape_of(RECORDED["telemetry"][key]) for key in fixed}


def test_lidar_text_is_the_recorded_text() -> None:
    text = RECORDED["telemetry"]["V1 LIDAR Range Array"]
    ahead_first = [float(word) for word in text.split()]
    for angle_min in (0.0, -math.pi):
        steps = round(angle_min / math.radians(1.0))
        data = telemetry(frame(vehicle(lidar=scan(list(np.roll(ahead_first, -steps)), angle_min))), PROFILES["2023"])
        assert data["V1 LIDAR Range Array"] == text


def test_messages_of_2020_have_neither_prefixes_nor_traffic_lights() -> None:
    recorded = [key.removeprefix("V1 ") for key in RECORDED["telemetry"] if not key.startswith("TL")]
    assert list(telemetry(frame(), PROFILES["2020"])) == recorded


def test_messages_of_2025_add_the_speed_and_a_decimal() -> None:
    data = telemetry(frame(), PROFILES["2025"])
    assert [key for key in data if key not in RECORDED["telemetry"]] == ["V1 Speed"]
    assert list(data).index("V1 Speed") == list(data).index("V1 Steering") + 1
    assert data["V1 Speed"] == "0.2000"  # driving backwards: the magnitude
    assert data["V1 Position"] == "1.0000 2.0000 0.0325"
    ranges = gzip.decompress(base64.b64decode(data["V1 LIDAR Range Array"])).decode()
    assert ranges == "\n".join(["1"] * 360)


def test_messages_of_the_league_have_all_its_keys() -> None:
    sent = frame(vehicle(velocity=np.array([2.0, -0.1, 0.0]), collision_count=3), vehicle())
    data = telemetry(sent, PROFILES["roboracer"])
    assert set(telemetry(sent, PROFILES["2025"])) - set(data) == {"V1 Rear Camera Image", "V2 Rear Camera Image"}
    for car in ("V1", "V2"):
        assert {f"{car} {key}" for key in LEAGUE_KEYS} <= set(data)
    assert (data["V1 Linear Velocity"], data["V1 Speed"]) == ("2.0000 -0.1000 0.0000", "2.0000")
    assert (data["V1 Collisions"], data["V2 Collisions"]) == ("3", "0")
    assert (data["V1 Lap Count"], data["V1 Lap Time"]) == ("0", "0.0000")
    assert float(data["V1 Last Lap Time"]) == float(data["V1 Best Lap Time"]) == math.inf  # as in the published node
    sizes = {("red", "rear"): (64, 48)}
    assert "V1 Rear Camera Image" in telemetry(sent, PROFILES["roboracer"], image_sizes=sizes)  # a car that has one


def test_messages_of_the_league_have_the_laps_of_the_race() -> None:
    race = RaceState(RaceStatus.RACING, 2, 12, 3.5, 9.25, 9.0, 20.0, 10.0, 1, 4, 5.0, 1, 0.0, False)
    data = telemetry(frame(vehicle(race=race, collision_count=9)), PROFILES["roboracer"])
    keys = ("Lap Count", "Lap Time", "Last Lap Time", "Best Lap Time", "Collisions")
    assert [data[f"V1 {key}"] for key in keys] == ["2", "3.5000", "9.2500", "9.0000", "1"]
    race = RaceState(RaceStatus.RACING, 1, 12, 3.5, 9.25, math.inf, 0.0, 0.0, 0, 4, 5.0, 1, 0.0, False)
    data = telemetry(frame(vehicle(race=race)), PROFILES["roboracer"])
    assert [data[f"V1 {key}"] for key in keys] == ["1", "3.5000", "9.2500", "Infinity", "0"]


@pytest.mark.parametrize("name", ["roboracer", "roboracer_f1tenth"])
def test_the_cars_of_the_league_have_its_profile(name: str) -> None:
    assert load_vehicle(name).devkit_profile == "roboracer"


def test_an_unknown_profile_of_a_vehicle_is_an_error_that_names_the_known_ones(tmp_path: Path) -> None:
    file = tmp_path / "car.yaml"
    file.write_text(find("vehicle", "roboracer").read_text().replace("profile: roboracer", "profile: robocar"))
    with pytest.raises(SpecError, match=r"devkit_profile .*'robocar' is not known\. Known: 2020, .*, roboracer"):
        load_vehicle(str(file))


LEAGUE_KEYS = """Throttle, Steering, Encoder Angles, Position, Orientation Quaternion, Angular Velocity,
Linear Velocity, Speed, Linear Acceleration, LIDAR Scan Rate, LIDAR Range Array, Front Camera Image, Lap Count,
Lap Time, Last Lap Time, Best Lap Time, Collisions""".replace("\n", " ").split(", ")
"""What the bridge node of the RoboRacer league reads, without prefix; 'Speed': its releases of 2025."""


@pytest.mark.parametrize("year", SIGNS)
def test_steering_has_the_sign_of_its_year(year: str) -> None:
    command, feedback = SIGNS[year]
    prefix = "" if year == "2020" else "V1 "
    assert float(telemetry(frame(), PROFILES[year])[prefix + "Steering"]) == feedback * 0.25
    orders = read_commands({prefix + "Steering": "0.5"}, PROFILES[year], {"red": Command()})
    assert orders.commands["red"].steering == command * 0.5


def test_each_setting_overrides_the_profile() -> None:
    recorded_simulator = DevkitSettings(steering="right").applied_to(PROFILES["2023"])
    assert (
        read_commands({"V1 Steering": "0.5"}, recorded_simulator, {"red": Command()}).commands["red"].steering == -0.5
    )
    assert telemetry(frame(), recorded_simulator) == telemetry(frame(), PROFILES["2023"])
    newest, text = PROFILES["2025"], PROFILES["2023"]
    mixed = DevkitSettings(lidar="text", feedback="right").applied_to(newest)
    expected = telemetry(frame(), newest) | {"V1 Steering": "-0.2500"}
    arrays = {key: value for key, value in telemetry(frame(), text).items() if "Array" in key}
    assert telemetry(frame(), mixed) == expected | arrays
    assert "Throttle" in telemetry(frame(), DevkitSettings(keys="plain").applied_to(newest))


@pytest.mark.parametrize("setting", ["profile", "keys", "lidar", "steering", "feedback", "handshake"])
def test_an_unknown_setting_is_an_error_that_names_the_known_ones(setting: str) -> None:
    with pytest.raises(AutodriveError, match=f"unknown devkit {setting} 'sideways'. Known: "):
        DevkitSettings(**{setting: "sideways"})  # pyright: ignore[reportArgumentType]


def test_quaternions_are_sent_as_xyzw() -> None:
    assert telemetry(frame(), PROFILES["2023"])["V1 Orientation Quaternion"] == "0.000 0.000 0.707 0.707"


def test_the_2020_position_is_that_of_the_body_centre() -> None:
    # heading along y: 0.08 m ahead of the rear axle is 0.08 m of y
    assert telemetry(frame(), PROFILES["2020"])["Position"] == "1.000 2.080 0.048"


@given(st.floats(-10, 10), st.sampled_from(list(PROFILES)))
def test_euler_angles_are_sent_in_zero_to_two_pi_even_when_rounded(angle: float, year: str) -> None:
    imu = msgspec.structs.replace(vehicle().imu, euler=np.array([angle, 0.0, -1e-9]))
    data = telemetry(frame(vehicle(imu=imu)), PROFILES[year])
    texts = data["Orientation Euler Angles" if year == "2020" else "V1 Orientation Euler Angles"].split()
    assert all(0.0 <= float(text) < 2.0 * math.pi and not text.startswith("-") for text in texts)
    difference = (float(texts[0]) - angle) % (2.0 * math.pi)
    assert min(difference, 2.0 * math.pi - difference) < 0.00051  # half of the last digit of F3


@pytest.mark.parametrize("year", PROFILES)
@pytest.mark.parametrize("angle", [0.0, -0.0, -1e-17, -1e-9, 1e-9, -4e-5, 4e-5, 2 * math.pi, -2 * math.pi, 6.283185])
def test_an_angle_of_zero_does_not_flicker(angle: float, year: str) -> None:
    imu = msgspec.structs.replace(vehicle().imu, euler=np.full(3, angle))
    texts = telemetry(frame(vehicle(imu=imu)), PROFILES[year])
    zero = f"{0:.{PROFILES[year].decimals}f}"
    assert texts["Orientation Euler Angles" if year == "2020" else "V1 Orientation Euler Angles"].split() == [zero] * 3


def test_a_target_too_near_and_no_target_are_both_inf() -> None:
    data = telemetry(frame(vehicle(lidar=scan([-math.inf, math.inf, 1.23456789, 0.15], 0.0))), PROFILES["2022"])
    assert data["V1 LIDAR Range Array"] == "inf inf 1.234568 0.15"
    assert data["V1 LIDAR Intensity Array"] == "47 47 47 47"


def test_a_scan_that_is_no_circle_keeps_its_order() -> None:
    part = scan([1.0, 2.0, 3.0], angle_min=-1.0, increment=1.0)
    assert telemetry(frame(vehicle(lidar=part)), PROFILES["2022"])["V1 LIDAR Range Array"] == "1 2 3"


@pytest.mark.parametrize("year", PROFILES)
def test_without_a_lidar_there_is_a_scan_without_returns_and_a_rate(year: str) -> None:
    data = telemetry(frame(vehicle(lidar=None)), replace(PROFILES[year], lidar="text"))
    prefix = "" if year == "2020" else "V1 "
    assert data[prefix + "LIDAR Range Array"] == " ".join(["inf"] * 360)
    assert len(data[prefix + "LIDAR Intensity Array"].split()) == 360
    assert float(data[prefix + "LIDAR Scan Rate"]) == 7.0


def test_vehicles_are_numbered_in_the_order_of_the_frame() -> None:
    data = telemetry(frame(vehicle(throttle=0.1), vehicle(throttle=0.2)), PROFILES["2025"])
    assert (data["V1 Throttle"], data["V2 Throttle"]) == ("0.1000", "0.2000")
    orders = read_commands({"V2 Throttle": 1}, PROFILES["2025"], {"red": Command(), "green": Command()})
    assert orders.commands == {"green": Command(throttle=1.0)}


def test_traffic_lights_show_the_command() -> None:
    orders = read_commands(RECORDED["commands"], PROFILES["2023"], {"red": Command()})
    data = telemetry(frame(), PROFILES["2023"], traffic_lights=orders.traffic_lights)
    assert [data[f"TL{n} State"] for n in (1, 2, 3, 4)] == ["1", "2", "3", "3"]


# -- pictures ----------------------------------------------------------------------------------------------------


def test_an_encoded_image_is_sent_unchanged() -> None:
    data = telemetry(frame(), PROFILES["2023"], images={("red", "rear"): b"\xff\xd8picture"})
    assert base64.b64decode(data["V1 Rear Camera Image"]) == b"\xff\xd8picture"
    assert data["V1 Front Camera Image"] == devkit.black_image(1280, 720)


def test_a_missing_image_is_black_and_has_the_size_of_its_camera() -> None:
    data = telemetry(frame(), PROFILES["2023"], image_sizes={("red", "front"): (640, 480), ("red", "rear"): (33, 17)})
    for side, width, height in (("Front", 640, 480), ("Rear", 33, 17)):
        picture = simplejpeg.decode_jpeg(base64.b64decode(data[f"V1 {side} Camera Image"]))
        assert picture.shape == (height, width, 3)
        assert not picture.any()


def poisoned(at: int) -> bytes:
    """A picture whose base64 holds 'null' in that one of the places, 0 to 3 characters into a group of four."""
    text = base64.b64encode(b"\xff\xd8\x00" * 40).decode()
    return base64.b64decode(text[: 40 + at] + "null" + text[44 + at :])


@pytest.mark.parametrize("at", range(4))
def test_no_image_contains_the_letters_null(at: int) -> None:
    picture = poisoned(at)
    assert b"null" in base64.b64encode(picture)
    text = telemetry(frame(), PROFILES["2023"], images={("red", "front"): picture})["V1 Front Camera Image"]
    assert "null" not in text
    sent = base64.b64decode(text)
    comment = len(sent) - len(picture)
    assert sent[:2] + sent[2 + comment :] == picture
    assert sent[2:4] == b"\xff\xfe"  # ITU-T T.81: COM, whose length counts itself but not the marker
    assert int.from_bytes(sent[4:6], "big") == comment - 2


def test_no_scan_contains_the_letters_null() -> None:
    def spells_null(ranges: list[float]) -> bool:
        text = "\n".join(f"{value:.7g}" for value in ranges)
        return b"null" in base64.b64encode(gzip.compress(text.encode(), 6, mtime=0))

    random = np.random.default_rng(377)
    ranges = random.uniform(0.15, 12.0, 360).tolist()
    while not spells_null(ranges):  # one of some thousand scans does: the first one here, by most builds of zlib
        ranges = random.uniform(0.15, 12.0, 360).tolist()
    text = telemetry(frame(vehicle(lidar=scan(ranges, 0.0))), PROFILES["2025"])["V1 LIDAR Range Array"]
    assert "null" not in text
    read = [float(line) for line in gzip.decompress(base64.b64decode(text)).decode().split("\n")]
    assert read == pytest.approx(ranges, rel=5e-7)  # seven digits


# -- detection of the devkit generation ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("keys", "year"),
    [
        (["Throttle", "Steering", "Headlights", "Indicators"], "2020"),
        (list(RECORDED["commands"]), "2023"),
        (["V1 Throttle", "V1 Steering", "V1 Reset"], "2025"),
        (["V1 CoSim", "V1 PosX"], "2025"),
        (["V12 Throttle"], "2023"),
        (["TL1 State"], None),
        ([], None),
    ],
)
def test_the_generation_is_recognised_by_the_keys_of_the_commands(keys: list[str], year: str | None) -> None:
    found = detect_profile(dict.fromkeys(keys, "0"))
    assert (found.name if found else None) == year


def test_a_script_may_send_its_steering_sign() -> None:
    data = {"V1 Steering": "0.5", "V1 Headlights": "0", "V1 Steering Sign": "right"}
    profile = detect_profile(data)
    assert profile
    assert (profile.name, profile.command_sign) == ("2023", RIGHT)
    assert read_commands(data, profile, {"red": Command()}).commands["red"].steering == -0.5
    assert not is_ambiguous(data)


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        (list(RECORDED["commands"]), True),
        (["V1 Throttle", "V1 Steering"], False),  # the car without lights exists since 2023
        (["V1 Throttle", "V1 Headlights", "V1 Reset"], False),
        (["V1 Throttle", "V1 Headlights", "Reset"], False),
        (["Throttle", "Headlights"], False),
    ],
)
def test_the_keys_of_2022_are_ambiguous(keys: list[str], expected: bool) -> None:
    assert is_ambiguous(dict.fromkeys(keys, "0")) is expected


def test_the_initial_message_has_the_keys_of_all_generations() -> None:
    data = initial_telemetry(frame())
    assert all(set(telemetry(frame(), profile)) <= set(data) for profile in PROFILES.values())


def test_the_initial_message_has_a_scan_in_the_requested_format() -> None:
    for year in ("2023", "2025"):
        data = initial_telemetry(frame(), lidar=PROFILES[year].lidar)
        assert data["V1 LIDAR Range Array"] == telemetry(frame(), PROFILES[year])["V1 LIDAR Range Array"]
        assert data["LIDAR Range Array"] == telemetry(frame(), PROFILES["2020"])["LIDAR Range Array"]


# -- orders ------------------------------------------------------------------------------------------------------


def test_recorded_commands_are_read() -> None:
    orders = read_commands(RECORDED["commands"], PROFILES["2025"], {"red": Command()})
    assert orders.commands == {"red": Command(1.0, 1.0, Headlights.LOW, Indicators.HAZARD)}
    assert orders.refused == []
    orders = read_commands({"V2 Throttle": "1"}, PROFILES["2025"], {"red": Command()})
    assert orders.refused == ["V2 Throttle: unknown vehicle; the number of a vehicle must be from 1 to 1"]


def test_every_key_is_optional_and_the_last_value_is_kept() -> None:
    before = Command(throttle=0.3, steering=-0.4, headlights=Headlights.HIGH)
    orders = read_commands({"V1 Throttle": "0.5"}, PROFILES["2025"], {"red": before})
    assert orders.commands == {"red": msgspec.structs.replace(before, throttle=0.5)}


@pytest.mark.parametrize("text", ["1", "1.000000", 1, 1.0, " 1e0 ", 7, "99"])
def test_numbers_may_be_texts_or_numbers_and_are_clamped(text: object) -> None:
    orders = read_commands({"V1 Throttle": text, "V1 Headlights": text}, PROFILES["2025"], {"red": Command()})
    assert orders.commands["red"].throttle == 1.0
    assert orders.commands["red"].headlights in {Headlights.LOW, Headlights.HIGH}


@pytest.mark.parametrize("value", [None, "None", ""])
def test_keys_that_were_never_set_are_ignored(value: object) -> None:
    orders = read_commands({"V1 Throttle": value, "V1 Indicators": value}, PROFILES["2023"], {"red": Command()})
    assert (orders.commands, orders.refused) == ({}, [])


@pytest.mark.parametrize("value", ["nan", "-inf", math.nan, math.inf, "0,5", "full", True, [1], {}, 10**400, "1e999"])
def test_a_number_that_is_not_finite_is_refused(value: object) -> None:
    orders = read_commands({"V1 Steering": value, "V1 Throttle": "0.1"}, PROFILES["2025"], {"red": Command()})
    assert orders.commands == {"red": Command(throttle=0.1)}
    assert len(orders.refused) == 1
    assert orders.refused[0].startswith("V1 Steering: must be a finite number, not ")


@pytest.mark.parametrize(("text", "is_held"), [("True", True), ("False", False), (True, True), (0, False), ("1", True)])
def test_reset_is_read(text: object, is_held: bool) -> None:
    assert read_commands({"V1 Reset": text}, PROFILES["2025"], {"red": Command()}).resets == {"red": is_held}


@pytest.mark.parametrize("profile", ["2025", "roboracer"])
def test_a_reset_without_prefix_is_that_of_all_vehicles(profile: str) -> None:
    vehicles = {"red": Command(), "green": Command()}
    orders = read_commands({"Reset": "True", "V2 Reset": "False"}, PROFILES[profile], vehicles)
    assert (orders.resets, orders.ignored) == ({"red": True, "green": True}, [])
    found = detect_profile({"V1 Throttle": "0", "Reset": "False"})
    assert found is PROFILES["2025"]


def test_keys_without_effect_are_named() -> None:
    orders = read_commands({"Reset": "True", "V1 Brake": "1", "Throttle": "1"}, PROFILES["2023"], {"red": Command()})
    assert (orders.resets, orders.commands) == ({}, {})
    assert orders.ignored == ["Reset", "V1 Brake", "Throttle"]


# -- environment and co-simulation -----------------------------------------------------------------------------


def test_the_environment_of_a_2025_script_is_read_and_checked() -> None:
    data = {"Auto Time": "False", "Time Scale": "60", "Time": "560", "Weather": "3", "Clouds": "0.0", "Fog": "0.5"}
    orders = read_commands(data, PROFILES["2025"], {"red": Command()})
    assert orders.environment == {
        "Auto Time": 0.0, "Time Scale": 60.0, "Time": 560.0, "Weather": 3.0, "Clouds": 0.0, "Fog": 0.5,
    }  # fmt: skip
    wrong = {"Auto Time": "maybe", "Time": "1500", "Weather": "9", "Rain": "-0.1", "Snow": "nan", "Time Scale": "None"}
    orders = read_commands(wrong, PROFILES["2025"], {"red": Command()})
    assert orders.environment == {}
    assert orders.refused == [
        "Auto Time: must be True or False, not 'maybe'",
        "Time: must be from 0 to 1440, not 1500",
        "Weather: must be from 0 to 8, not 9",
        "Rain: must be from 0 to 1, not -0.1",
        "Snow: must be a finite number, not 'nan'",
    ]


POSE = {"PosX": "1.5", "PosY": "-2", "PosZ": "0.1", "RotX": "0", "RotY": "0", "RotZ": "0.6", "RotW": "0.8"}


def cosim(number: int, **changes: str) -> dict[str, str]:
    return {f"V{number} {key}": text for key, text in {"CoSim": "1", **POSE, **changes}.items()}


def test_a_co_simulated_vehicle_gets_its_pose_with_the_quaternion_as_wxyz() -> None:
    vehicles = {"red": Command(), "green": Command()}
    orders = read_commands(cosim(2), PROFILES["2025"], vehicles)
    assert orders.holds == {"green": Hold("green", (1.5, -2.0, 0.1), (0.8, 0.0, 0.0, 0.6))}
    assert read_commands(cosim(1, CoSim="0"), PROFILES["2025"], vehicles).holds == {"red": Hold("red", None)}
    assert read_commands(cosim(1) | {"V1 CoSim": None}, PROFILES["2025"], vehicles).holds == {}


def test_an_invalid_pose_is_refused() -> None:
    for pose, error in (
        ({"PosX": "far", "RotZ": "0", "RotW": "0"}, "the pose is not complete: PosX missing"),
        ({"RotZ": "0", "RotW": "0"}, "the length of the quaternion must be above 0 and at most 1e6"),
        ({"RotW": "1e300"}, "the length of the quaternion must be above 0 and at most 1e6"),
        ({"PosY": "-1e5"}, "a position must be from -10000 to 10000 m"),
    ):
        message = read_commands(cosim(1, **pose), PROFILES["2025"], {"red": Command()})
        assert message.holds == {}
        assert message.refused[-1] == f"co-simulation of red: {error}"


KEYS = st.one_of(
    st.text(max_size=20),
    st.builds(
        "{}{}".format,
        st.sampled_from(["", "V1 ", "V2 ", "V0 ", "V99 ", "V٣ "]),
        st.sampled_from(["Throttle", "Steering", "Headlights", "Indicators", "Reset", "Brake", "CoSim", *POSE, ""]),
    ),
    st.sampled_from(["TL1 State", "TL0 State", "TL9 State", "Traffic Light 2", *ENVIRONMENT]),
)
SCALARS = st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=12))
VALUES = st.one_of(SCALARS, st.lists(SCALARS, max_size=2), st.dictionaries(st.text(max_size=3), SCALARS, max_size=2))


@given(st.dictionaries(KEYS, VALUES, max_size=8), st.sampled_from(list(PROFILES.values())))
def test_any_message_gives_valid_commands(data: dict[str, object], profile: Profile) -> None:
    detect_profile(data)
    orders = read_commands(data, profile, {"red": Command(), "green": Command()})
    assert len(orders.refused) <= len(data) + 2  # and a pose of each vehicle
    for command in orders.commands.values():
        assert -1.0 <= command.throttle <= 1.0
        assert -1.0 <= command.steering <= 1.0
    assert all(state in range(4) for state in orders.traffic_lights.values())
