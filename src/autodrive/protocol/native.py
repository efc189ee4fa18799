"""The conversation of the native protocol `autodrive.v1`: what client and server say around Commands and Frames.

Each WebSocket message is one of these, in MessagePack (`codec.py`). The client speaks first, with a `Hello`; the server
answers with a `Welcome` and a `Scene`, or with a `Fault` and an end. From then on either side speaks when it likes.
"""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

import msgspec

from autodrive.protocol.messages import CameraIntrinsics, Command, Frame, LidarScan, Pose, Request
from autodrive.protocol.ports import DEVKIT_PORT

PROTOCOL = 1
"""Version of this conversation. Additions keep it; what breaks a client makes it greater."""

SUBPROTOCOL = f"autodrive.v{PROTOCOL}"
"""Of the WebSocket."""

Vector: TypeAlias = tuple[float, float, float]
Source: TypeAlias = Literal["script", "person"]
"""Where a command comes from. A vehicle in autonomous mode obeys scripts, in manual mode a person."""

# -- from the client --------------------------------------------------------------------------------------------


class Hello(msgspec.Struct, frozen=True, tag=True):
    """The first message: the version that the client speaks, and what others shall call it."""

    protocol: int
    name: str = ""


class Subscribe(msgspec.Struct, frozen=True, tag=True):
    """What this client wants to be sent from now on; before the first, Frames at 60 Hz without scans or pictures.

    `frame_rate`: Frames a second of wall time at most [Hz], None: each tick, 0: none. `scans`: whether scans come.
    `picture_rate`: pictures of each camera a second of wall time at most [Hz], 0: none; `picture_width` [pixels], None:
    the camera's own; `picture_quality` of the JPEG, 1 to 100. A client that is slow gets the latest, never a backlog.
    """

    frame_rate: float | None = 60.0
    scans: bool = False
    picture_rate: float = 0.0
    picture_width: int | None = None
    picture_quality: int = 75


class Drive(msgspec.Struct, frozen=True, tag=True):
    """A command for one vehicle. Whoever commands it holds its wheel until a `Release` or two silent seconds.

    A vehicle in manual mode obeys a person, in autonomous mode a script. A Command is good for the scenario's
    command time-out (0.5 s of simulated time by default): send it again to keep going.
    """

    vehicle: str
    command: Command
    source: Source = "script"


class Release(msgspec.Struct, frozen=True, tag=True):
    """Let go of that vehicle's wheel."""

    vehicle: str


class ConnectBridge(msgspec.Struct, frozen=True, tag=True):
    """Connect the simulator to the devkit script that listens there."""

    host: str = "127.0.0.1"
    port: int = DEVKIT_PORT


class DisconnectBridge(msgspec.Struct, frozen=True, tag=True):
    """End that connection, or the search for one."""


class SetCamera(msgspec.Struct, frozen=True, tag=True):
    """Have a scene camera drawn by the simulator for this client, who gets `Rendered` pictures; `camera` None: no more.

    `camera`: a name of `Scene.scene_cameras`, or `Orbit`. `vehicle`: the one to follow, None: the first. `height` [m]
    is that of the Bird's Eye; `azimuth`, `elevation` [rad] and `distance` [m] place the orbit around the vehicle.
    """

    camera: str | None
    vehicle: str | None = None
    height: float = 3.0
    azimuth: float = 0.0
    elevation: float = 0.5
    distance: float = 1.0
    width: int = 960
    rate: float = 30.0


Ask: TypeAlias = Request | ConnectBridge | DisconnectBridge | SetCamera
"""All that can be requested."""


class Please(msgspec.Struct, frozen=True, tag=True):
    """A request; its `Done` or `Fault` carries the same `id`."""

    id: int
    request: Ask


ClientMessage: TypeAlias = Hello | Subscribe | Drive | Release | Please

# -- from the server --------------------------------------------------------------------------------------------


class Welcome(msgspec.Struct, frozen=True, tag=True):
    """The server's first message: versions, the name that others see, and the scenarios that can be loaded."""

    protocol: int
    version: str
    name: str
    scenarios: dict[str, str]
    """Name -> title."""


class Lamp(msgspec.Struct, frozen=True):
    """A lamp of a vehicle: place in the vehicle frame [m], linear RGB, how far it lights [m]."""

    position: Vector
    color: Vector
    range: float


class VehicleScene(msgspec.Struct, frozen=True):
    """A vehicle as a viewer needs it. `model`: its .glb, relative to the page."""

    type: str
    model: str
    half_length: float
    """Largest half-extent [m]."""
    steering_limit: float
    """[rad]."""
    lamps: dict[str, Lamp]
    """By the names of `actuators.lights.LAMPS`."""
    cameras: list[str]
    """Names of the sensor cameras."""
    lidar: Pose | None
    """Of the scan's axes in the vehicle frame."""
    wheelbase: float
    """[m]."""
    wheel_radius: float
    """[m]."""
    speed_limit: float
    """Of the driven wheels' tread at full throttle [m/s]."""
    sensor_noise: dict[str, float]
    """Standard deviation of a sample, of its offset too, by quantity and in its unit: 'encoder_angle' [rad], 'ips' [m],
    'imu_orientation' [rad], 'imu_angular_velocity' [rad/s], 'imu_linear_acceleration' [m/s^2]; 0: it is exact."""


class Scene(msgspec.Struct, frozen=True, tag=True):
    """What there is to draw; sent after the Welcome and whenever another scenario is loaded, before its first Frame."""

    scenario: str
    title: str
    map: str
    tick: float
    """Simulated time between Frames [s]."""
    model: str
    """The map's .glb, relative to the page."""
    vehicles: dict[str, VehicleScene]
    objects: dict[str, str]
    """Movable thing -> its .glb."""
    light_table: dict[str, Any]
    """`render.look.light_table`."""
    scene_cameras: dict[str, dict[str, Any]]
    """`render.viewpoints.scene_cameras`."""


class BridgeStatus(msgspec.Struct, frozen=True):
    """How the connection to a devkit script stands; `fault` says why there is none."""

    address: str = f"127.0.0.1:{DEVKIT_PORT}"
    state: Literal["closed", "connecting", "connected"] = "closed"
    fault: str = ""
    telemetry_rate: float = 0.0
    """Messages sent in a second of wall time [Hz]."""
    command_rate: float = 0.0
    """Messages received, likewise."""
    round_trip: float | None = None
    """Median [s]."""


class Status(msgspec.Struct, frozen=True, tag=True):
    """What is not part of the world; sent four times a second, and at once when something in it was switched."""

    is_paused: bool
    speed: float | None
    """Simulated seconds per wall second that were asked for; None: as fast as possible."""
    real_time_factor: float
    late_ticks: int
    viewers: int
    drivers: dict[str, str]
    """Vehicle -> name of the client that holds its wheel; who nobody holds is not there."""
    bridge: BridgeStatus
    cameras_fault: str = ""
    """Why there are no pictures; empty if there are, or if nobody wants some."""
    note: str = ""
    """What is going on that takes a while, for example a scenario that is loaded."""


class Scan(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A new LIDAR scan; comes before the first Frame that it belongs to."""

    vehicle: str
    scan: LidarScan


class Picture(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A new picture of a sensor camera as JPEG; comes before the first Frame that it belongs to."""

    vehicle: str
    camera: str
    time: float
    pose: Pose
    """Map from optical frame."""
    intrinsics: CameraIntrinsics
    """Of the camera; the picture is `picture_width` wide."""
    jpeg: bytes


class Rendered(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A picture of the scene camera asked for with `SetCamera`, of that simulated time [s]."""

    time: float
    jpeg: bytes


class Done(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A request was carried out; this is the Frame after it, with all events since the last Frame sent."""

    id: int
    frame: Frame


class Fault(msgspec.Struct, frozen=True, tag=True, gc=False):
    """Something could not be done; `text` says what, and what would be right. `id`: of the request, if it was one.

    `code`: 'version' (of the Hello), 'message' (not understood), 'request' (refused), 'taken' (somebody else holds the
    wheel), 'mode' (the driving mode lets others drive), 'rate' (too many messages).
    """

    code: Literal["version", "message", "request", "taken", "mode", "rate"]
    text: str
    id: int | None = None


ServerMessage: TypeAlias = Welcome | Scene | Status | Scan | Picture | Rendered | Done | Fault | Frame
"""A streamed Frame has neither scans nor pictures, which come by themselves, and all events since the last one sent."""
