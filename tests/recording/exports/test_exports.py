"""Each export is read back by the tool that it is for."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import autodrive
from autodrive import Command, Simulation
from autodrive.protocol.messages import LoadScenario
from autodrive.recording import Recorder, Recording, RecordingError
from autodrive.recording import open as open_recording
from autodrive.recording.drives.recorder_log import read
from autodrive.recording.exports import FORMATS, export
from autodrive.recording.exports.bag import DEFINITIONS
from autodrive.recording.exports.options import ExportOptions
from autodrive.scenario.vehicles.spec import load_vehicle

ROOT = Path(__file__).parents[3]


def test_csv_has_every_signal(lap: Recording, tmp_path: Path) -> None:
    folder = export(lap, "csv", tmp_path / "csv", ExportOptions(start=0.2))
    with (folder / "V1.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 81
    assert [float(row["ips.position.x"]) for row in rows] == lap["V1/ips/position"][20:, 0].tolist()
    assert float(rows[-1]["time"]) == 1.0
    with (folder / "V1_lidar.csv").open() as file:
        header, *scans = csv.reader(file)
    assert header[:4] == ["time", "angle_min", "angle_increment", "range_0"]
    assert (len(header), len(scans)) == (363, int(np.sum(lap.signals.times("V1/lidar/ranges") >= 0.2)))
    scan = lap.frame_at(1.0).vehicles["V1"].lidar
    assert scan is not None
    assert [float(value) for value in scans[-1][1:]] == [scan.angle_min, scan.angle_increment, *scan.ranges]
    with (folder / "commands.csv").open() as file:
        commands = list(csv.DictReader(file))
    assert (commands[0]["time"], commands[-1]["throttle"], commands[-1]["tick"]) == ("0.2", "0.8", "99")
    with pytest.raises(RecordingError, match="a row for each Frame and each scan"):
        export(lap, "csv", tmp_path / "slow", ExportOptions(rate=10.0))


def test_a_table_is_a_data_frame(lap: Recording) -> None:
    pandas, polars = lap.table("V1"), lap.table("V1", "polars")
    assert len(pandas) == len(polars) == 101
    assert pandas["velocity.x"].tolist() == polars["velocity.x"].to_list() == lap["V1/velocity"][:, 0].tolist()
    with pytest.raises(RecordingError, match="'pandas' or 'polars'"):
        lap.table("V1", "excel")  # type: ignore[arg-type]  # pyright: ignore


def test_the_layout_of_the_data_recorder_is_read_back(lap: Recording, tmp_path: Path) -> None:
    folder = export(lap, "autodrive", tmp_path / "log", ExportOptions(rate=20.0))
    with (folder / "V1 Log.csv").open() as file:
        rows = list(csv.reader(file))
    assert all(len(row) == 21 for row in rows)
    assert re.fullmatch(r"\d{4}(_\d{2}){5}_\d{3}", rows[0][0])
    assert len(rows) == 21
    log = read(folder / "V1 Log.csv")
    np.testing.assert_allclose(log.time, np.linspace(0.0, 1.0, 21), atol=0.0011)  # time stamps have milliseconds
    np.testing.assert_array_equal(log.position, lap["V1/ips/position"][::5])
    np.testing.assert_array_equal(log.steering, lap["V1/steering"][::5])
    np.testing.assert_array_equal(log.angular_velocity, lap["V1/imu/angular_velocity"][::5])
    np.testing.assert_array_equal(log.acceleration, lap["V1/imu/linear_acceleration"][::5])
    assert log.images[-1][0].startswith("V1 Camera Frames/Camera0_Frame_")
    assert (folder / log.images[-1][1]).read_bytes()[:2] == b"\xff\xd8"
    assert len(log.ranges[-1]) == 360


def test_the_log_of_a_race_car_has_22_columns_with_three_velocities_and_one_image(gl: str, tmp_path: Path) -> None:
    file = tmp_path / "race.mcap"
    vehicle = {"type": "roboracer", "sensors": {"front": {"rate": 10.0}}}
    world = autodrive.make(autodrive.Scenario(vehicles={"V1": vehicle}), cameras="small")  # type: ignore[dict-item]  # pyright: ignore
    with Recorder(file, world, has_meshes=False):
        for _ in range(30):
            world.step({"V1": Command(0.5, 0.5)})
    with open_recording(file) as recording:
        folder = export(recording, "autodrive", tmp_path / "log", ExportOptions(rate=100.0))
        frame = recording.frame_at(0.3).vehicles["V1"]
        picture = recording.picture_at("V1", "front", 0.3)
    with (folder / "V1 Log.csv").open() as log_file:
        rows = list(csv.reader(log_file))
    assert {len(row) for row in rows} == {22}
    assert frame.lidar is not None
    expected = [
        frame.throttle,
        frame.steering,
        *frame.encoders.ticks,
        *frame.ips.position,
        *frame.imu.euler,
        *frame.velocity,
        *frame.imu.angular_velocity,
        *frame.imu.linear_acceleration,
    ]
    assert [float(value) for value in rows[-1][1:20]] == expected
    assert picture is not None
    assert (folder / rows[-1][20]).read_bytes() == picture.jpeg
    assert [float(value) for value in rows[-1][21].split()] == frame.lidar.ranges.tolist()
    log = read(folder / "V1 Log.csv")
    assert (log.vehicle_type, log.images[-1]) == ("roboracer", (rows[-1][20],))
    assert log.speed[-1] == frame.velocity[0]
    np.testing.assert_array_equal(log.acceleration[-1], frame.imu.linear_acceleration)


def test_each_column_of_a_foreign_log_is_read(tmp_path: Path) -> None:
    """The order of the columns is that of AutoDRIVE; its RoboRacer car has three velocities and one image."""
    path = tmp_path / "V1 Log.csv"
    for kind, speeds, images in (("nigel", 1, ("a.jpg", "b.jpg")), ("roboracer", 3, ("a.jpg",))):
        numbers = [float(i) for i in range(1, 17 + speeds)]
        rows = [
            ["2026_01_31_13_45_10_250", *map(str, numbers), *images, "0.5 inf 2.5"],
            ["2026_01_31_13_45_10_283", *map(str, numbers), *images, "0.5 inf 2.5"],
        ]
        path.write_text("".join(",".join(row) + "\n" for row in rows))
        log = read(path)
        assert log.vehicle_type == kind
        assert log.time == pytest.approx([0.0, 0.033])
        assert (log.throttle[1], log.steering[1], log.ticks[1].tolist()) == (1.0, 2.0, [3.0, 4.0])
        assert (log.position[1].tolist(), log.euler[1].tolist()) == ([5.0, 6.0, 7.0], [8.0, 9.0, 10.0])
        after = 11.0 + speeds
        assert log.speed[1] == 11.0
        assert log.angular_velocity[1].tolist() == [after, after + 1.0, after + 2.0]
        assert log.acceleration[1].tolist() == [after + 3.0, after + 4.0, after + 5.0]
        assert (log.images[1], log.ranges[1].tolist()) == (images, [0.5, np.inf, 2.5])
        assert read(path, is_left_positive=False).steering[1] == -2.0


def test_a_log_that_is_wrong_is_refused(tmp_path: Path) -> None:
    row = ",".join(["2026_01_31_13_45_10_250", *["0"] * 17, "", "", ""])
    for text, reason in (
        ("1,2,3\n", "line 1 has 3 columns"),
        (f"{row}\n", "has 1 lines"),
        (f"{row}\n{row.replace('2026_', 'now_')}\n", "line 2: the time stamp must be such as"),
        (f"{row}\n{row.replace('0,0,0', '0,x,0', 1)}\n", "line 2: could not convert"),
        (f"{row}\n{row.replace('2026', '2025')}\n", "line 2: the time stamp is earlier"),
    ):
        path = tmp_path / "log.csv"
        path.write_text(text)
        with pytest.raises(RecordingError, match=reason):
            read(path)


@pytest.mark.parametrize("form", ["rosbag2", "rosbag1"])
def test_a_bag_is_read_by_rosbags(lap: Recording, tmp_path: Path, form: str) -> None:
    path = export(lap, form, tmp_path / f"lap{FORMATS[form].suffix}")
    messages = messages_of(path, form)
    counts = {topic: len(of) for topic, of in messages.items()}
    last = {topic: of[-1] for topic, of in messages.items()}
    root = "/autodrive/nigel_1"
    assert counts[f"{root}/scan"] == len(lap["V1/lidar/ranges"])
    assert counts[f"{root}/imu/data"] in range(29, 34)
    assert counts["/clock"] == 101
    front = len(list(lap.pictures("V1", "front")))
    compressed = [topic for topic in counts if "front" in topic and topic.endswith("compressed")]
    assert [counts[topic] for topic in compressed] == [front]
    time, scan = last[f"{root}/scan"]
    assert len(scan.ranges) == 360
    assert time == pytest.approx(1_000_000_000, abs=100)  # [ns]: each message is later than the one before it
    times = [time for of in messages.values() for time, _ in of]
    assert (min(times), len({*times})) == (1, len(times))  # ROS 1 does not read messages at time 0
    poses = [
        (at, one.header.stamp) for at, tf in messages["/tf"] for one in tf.transforms if one.child_frame_id == "odom"
    ]
    for at, scan in messages[f"{root}/scan"]:  # its transform comes before it
        stamp = max((seconds(of) for time, of in poses if time < at), default=-1.0)
        assert stamp >= seconds(scan.header.stamp)
    assert last[f"{root}/joint_states"][1].name[0]
    truth = last[f"{root}/ground_truth/odom"][1].pose.pose.position
    assert truth.x == pytest.approx(lap["V1/pose/position"][-1, 0], abs=0.1)  # the last state is at most 1/30 s old
    assert last["/tf"][1].transforms


def test_a_camera_has_one_matrix_in_recordings_bags_and_images(lap: Recording, tmp_path: Path) -> None:
    """In OpenCV, pixels are counted from 0 at their centres: the middle of 640 x 480 pixels is 319.5, 239.5."""
    with lap.path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[ProtobufDecoder()])
        recorded = next(reader.iter_decoded_messages(["/V1/cameras/front/calibration"])).decoded_message
    messages = messages_of(export(lap, "rosbag2", tmp_path / "lap"), "rosbag2")
    _, info = messages["/autodrive/nigel_1/front_camera/camera_info"][0]
    matrix = lap.frame_at(1.0).vehicles["V1"].cameras["front"].intrinsics.matrix
    np.testing.assert_array_equal(matrix[:, 2], [319.5, 239.5, 1.0])
    np.testing.assert_array_equal(recorded.K, matrix.ravel())
    np.testing.assert_array_equal(info.k, matrix.ravel())
    np.testing.assert_array_equal(recorded.P, info.p)


def test_our_messages_in_bags_are_those_of_the_ros_packages() -> None:
    for name, text in DEFINITIONS.items():
        file = ROOT / "ros" / "ros2" / "autodrive_msgs" / "msg" / f"{name.rpartition('/')[2]}.msg"
        assert get_types_from_msg(text, name) == get_types_from_msg(file.read_text(), name)


def test_an_export_replaces_nothing_and_says_what_is_wrong(lap: Recording, tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="would replace"):
        export(lap, "csv", tmp_path)
    with pytest.raises(RecordingError, match="Did you mean 'rosbag2'"):
        export(lap, "rosbag3", tmp_path / "a")
    with pytest.raises(RecordingError, match="vehicle 'V9' is not in the recording"):
        export(lap, "csv", tmp_path / "a", ExportOptions(vehicle="V9"))
    assert not (tmp_path / "a").exists()


def messages_of(path: Path, form: str) -> dict[str, list[tuple[int, Any]]]:
    """Time [ns] and content of the messages of each topic in a bag."""
    found: dict[str, list[tuple[int, Any]]] = {}
    store = get_typestore(Stores.ROS2_JAZZY if form == "rosbag2" else Stores.ROS1_NOETIC)
    with AnyReader([path], default_typestore=store) as reader:
        for connection, time, data in reader.messages():
            content = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, content))
    return found


def seconds(stamp: Any) -> float:
    return float(stamp.sec + 1e-9 * stamp.nanosec)


def test_each_car_of_a_bag_has_its_own_description_frames_and_number(tmp_path: Path) -> None:
    """At 0.5 s, another scenario is loaded: V1 becomes a RoboRacer car, V2 comes, and so does a car of the traffic."""
    mixed = autodrive.Scenario(
        map="tiny_town",
        vehicles={"V1": {"type": "roboracer"}, "V2": {"type": "nigel", "x": 1.0}},  # type: ignore[dict-item]  # pyright: ignore
        traffic={"cars": 1},  # type: ignore[arg-type]  # pyright: ignore
    )
    file = tmp_path / "run.mcap"
    simulation = Simulation(autodrive.make("plane"), speed=None, load=lambda _: autodrive.make(mixed))
    with Recorder(file, simulation, has_meshes=False):
        simulation.run(0.5)
        loaded = simulation.request(LoadScenario("mixed"))
        simulation.run(0.2)
        loaded.result()
    with open_recording(file) as recording:
        assert recording.vehicles == ("V1", "V2", "traffic_1")
        whole = messages_of(export(recording, "rosbag2", tmp_path / "whole"), "rosbag2")
        part = export(recording, "rosbag1", tmp_path / "part.bag", ExportOptions("V2", start=0.6))
        tables = export(recording, "csv", tmp_path / "tables")
        log = read(export(recording, "autodrive", tmp_path / "log") / "V2 Log.csv")
        with pytest.raises(RecordingError, match="vehicle 'traffic_1' is traffic"):
            export(recording, "rosbag2", tmp_path / "third", ExportOptions("traffic_1"))
    second = messages_of(part, "rosbag1")
    described = {topic: messages for topic, messages in whole.items() if topic.endswith("/robot_description")}
    kinds = {"nigel_1": "nigel", "roboracer_1": "roboracer", "nigel_2": "nigel"}
    assert {*described} == {f"/autodrive/{name}/robot_description" for name in kinds}
    for name, kind in kinds.items():
        ((_, message),) = described[f"/autodrive/{name}/robot_description"]
        assert f'<robot name="{kind}">' in message.data
    before, after = ({one.child_frame_id: one for one in of.transforms} for _, of in whole["/tf_static"])
    for frame, kind in ((before["lidar"], "nigel"), (after["lidar"], "roboracer"), (after["nigel_2/lidar"], "nigel")):
        lidar, at = load_vehicle(kind).sensors.lidar, frame.transform.translation
        assert lidar is not None
        assert (at.x, at.y, at.z) == pytest.approx(lidar.mount.position)
    with (tables / "V1_lidar.csv").open() as scans:
        assert {len(row) - row.count("") for row in csv.reader(scans)} == {3 + 360, 3 + 1081}
    assert (log.vehicle_type, log.time[-1]) == ("nigel", pytest.approx(0.2))
    # a bag of one vehicle and of a part of the time: names as in the whole bag, and nothing before its start
    assert {topic.split("/")[2] for topic in second if re.match("/autodrive/(?!tl_)", topic)} == {"nigel_2"}
    assert min(time for messages in second.values() for time, _ in messages) == 600_000_000  # [ns]
    (_, imu), *_ = second["/autodrive/nigel_2/imu"]
    noise = load_vehicle("nigel").sensors.imu.noise.angular_velocity
    assert imu.angular_velocity_covariance[0] == pytest.approx(max(noise.sigma**2 + noise.step**2 / 12.0, 1e-9))
