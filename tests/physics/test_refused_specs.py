"""Parts of a vehicle's file that contradict themselves are refused in words."""

from __future__ import annotations

from typing import Any

import pytest

from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec
from autodrive.physics.actuators.drivetrain import DifferentialSpec, DrivetrainSpec
from autodrive.physics.actuators.steering import SteeringSpec
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.lidar.lidar import LidarSpec
from autodrive.physics.sensors.range import RangeSpec
from autodrive.physics.sensors.sensor import Mount
from autodrive.scenario.vehicles.spec import AxlesSpec, WheelSpec, load_vehicle

CAR = load_vehicle("roboracer_f1tenth")
TORQUE = CAR.drivetrain.model_dump() | {"control": "torque", "torque_curve": ()}
CAMERA = {"mount": Mount(), "width": 640, "height": 480, "field_of_view_deg": 41.669}


@pytest.mark.parametrize(
    ("kind", "fields", "text"),
    [
        (LidarSpec, {"rays": 362, "angle_increment_deg": 1}, "at most 360 deg, not 361 deg"),
        (LidarSpec, {"range_min": 5, "range_max": 4}, "range_max 4 m must be above range_min 5 m"),
        (LidarSpec, {"angle_max_deg": 90, "angle_increment_deg": 1}, "not both"),
        (LidarSpec, {"rays": 1, "angle_max_deg": 90}, "angle_min_deg only, not angle_max_deg"),
        (LidarSpec, {"angle_increment_deg": 0}, "must not be 0"),
        (RangeSpec, {"range_min": 0.2, "range_max": 0.1}, "range_max 0.1 m must be above range_min 0.2 m"),
        (Mount, {"rotation_deg": (0, 0, 1), "quaternion": (1, 0, 0, 0)}, "not both"),
        (Mount, {"quaternion": (1, 1, 0, 0)}, "must be 1, not 1.414"),
        (CameraSpec, CAMERA | {"field_of_view_deg": None}, "needs field_of_view_deg"),
        (CameraSpec, CAMERA | {"fit": "sensor", "focal_length": 0.0036}, "needs sensor_size"),
        (CameraSpec, CAMERA | {"fit": "horizontal"}, "needs focal_length and sensor_size"),
        (CameraSpec, CAMERA | {"near": 2.0, "far": 1.0}, "must be greater than near"),
        (CameraSpec, CAMERA | {"field_of_view_deg": 180.0}, "less than 180"),
        (CameraSpec, CAMERA | {"width": 0}, "at least 1"),
        (CameraSpec, CAMERA | {"imperfections": "raspberry_pi_v3"}, "Did you mean 'raspberry_pi_v"),
        (CameraSpec, CAMERA | {"imperfections": {"exposures": 4}}, "must be odd"),
        (CameraSpec, CAMERA | {"imperfections": {"distortion": (-0.9, 0, 0, 0, 0)}}, "nothing in the corners"),
        (CameraSpec, CAMERA | {"imperfections": {"read_noise": -1.0}}, "must be at least 0"),
        (AxlesSpec, {"rear": {"is_driven": False}}, "no axle is driven; set is_driven: true"),
        (AxlesSpec, {"rear": {"is_steered": True}}, "only the front axle can be steered"),
        (AxlesSpec, {"front": {"is_steered": False}}, "only the front axle can be steered"),
        (AxlesSpec, {"front": {"driven": True}}, "Did you mean 'is_driven'?"),
        (DifferentialSpec, {"kind": "locked", "preload": 1}, "are only for kind: limited_slip"),
        (DifferentialSpec, {"kind": "limited_slip"}, "needs preload or bias above 0"),
        (DrivetrainSpec, CAR.drivetrain.model_dump() | {"torque_curve": [[0, 1], [0, 0.5]]}, "rising speeds"),
        (DrivetrainSpec, CAR.drivetrain.model_dump() | {"throttle_curve": [[0, 0], [1, 1]]}, "throttle_curve is for"),
        (DrivetrainSpec, TORQUE | {"throttle_curve": [[0.5, 0], [0.5, 1]]}, "with rising throttle"),
        (DrivetrainSpec, TORQUE | {"speed_gain": 0.9}, "are for control: speed"),
        (DrivetrainSpec, TORQUE | {"control": "voltage", "torque_curve": [[0, 1], [9, 0]]}, "the torque falls"),
        (SteeringSpec, CAR.steering.model_dump() | {"curve": [[0, 5], [1, 4]]}, "angles that do not fall"),
        (SteeringSpec, CAR.steering.model_dump() | {"command_limits": [0.5, 0.5]}, "must be smaller"),
        (WheelSpec, dict(CAR.wheels) | {"forward_friction": None, "magic_formula": None}, "or magic_formula alone"),
    ],
)
def test_contradictions_are_refused(kind: type[Spec], fields: dict[str, Any], text: str) -> None:
    with pytest.raises(SpecError) as caught:
        kind(**fields)
    assert text in str(caught.value)
