"""The messages of the native protocol `autodrive.v2` between client and server, apart from Commands and Frames.

Each WebSocket message is one of these, in MessagePack (`codec.py`). The client sends a `Hello` first; the server
answers with a `Welcome` and a `Scene`, or sends an `Error` and closes. After that both sides send at any time. A server
that has no world yet sends `Starting` until it has one.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.protocol.messages import (
    Array,
    CameraIntrinsics,
    Command,
    Drawing,
    Frame,
    LidarScan,
    MapPart,
    Name,
    Operation,
    Pose,
    TrackLine,
)
from autodrive.protocol.own_files import FileOperation, OwnFile
from autodrive.protocol.ports import DEVKIT_PORT
from autodrive.protocol.replay import Curve, RecordingOperation, RecordingStatus, Timeline

PROTOCOL = 2
"""Version of the protocol. Additions keep it; a change that breaks clients increases it."""

SUBPROTOCOL = f"autodrive.v{PROTOCOL}"
"""Subprotocol of the WebSocket."""

Vector: TypeAlias = tuple[float, float, float]
Source: TypeAlias = Literal["script", "person"]
"""Origin of a command. A vehicle in autonomous mode obeys scripts, in manual mode a person."""
CarState: TypeAlias = Literal["drives", "succeeded", "failed"]
"""What a car does in an episode of an environment."""
HostName: TypeAlias = Annotated[str, msgspec.Meta(max_length=253)]
"""A host name (RFC 1035) or an IP address."""
Rate: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1e6)]
"""A rate in wall time [Hz]."""

# -- from the client --------------------------------------------------------------------------------------------


class Hello(msgspec.Struct, frozen=True, tag=True):
    """The first message: the version that the client speaks, and its display name."""

    protocol: int
    name: str = ""


class Subscribe(msgspec.Struct, frozen=True, tag=True):
    """Selects what the client is sent. Before the first Subscribe: Frames at 60 Hz, no scans, no pictures.

    `frame_rate`: largest rate of Frames in wall time [Hz], None: each tick, 0: none. `scans`, `drawings`: whether they
    are sent, as for `shapes` (`Shapes`) and `contacts` (`Contacts`), which cost time only while a client wants them.
    `picture_rate`: largest rate of pictures of each camera in wall time [Hz], 0: none; `picture_width` [pixels], None:
    the width of the camera; `picture_quality` of the JPEG, 1 to 100. A slow client gets the latest Frame, never a
    backlog. `frames_of_readings`: whether the Frame of a scan or picture follows it at once, also beyond `frame_rate`.
    `ways`: whether `Ways` are sent.
    """

    frame_rate: Rate | None = 60.0
    scans: bool = False
    picture_rate: Rate = 0.0
    picture_width: int | None = None
    picture_quality: int = 75
    drawings: bool = False
    shapes: bool = False
    contacts: bool = False
    frames_of_readings: bool = False
    ways: bool = False


class Drive(msgspec.Struct, frozen=True, tag=True):
    """A command for one vehicle. The client becomes its driver until a `Release` or 2 s without a command.

    A vehicle in manual mode obeys a person, in autonomous mode a script. A Command is valid for the scenario's
    command time-out (0.5 s of simulated time by default): send it again to keep driving.
    """

    vehicle: Name
    command: Command
    source: Source = "script"


class Release(msgspec.Struct, frozen=True, tag=True):
    """Stop being the driver of that vehicle."""

    vehicle: Name


class ConnectBridge(msgspec.Struct, frozen=True, tag=True):
    """Connect the simulator to the devkit script that listens at that address."""

    host: HostName = "127.0.0.1"
    port: int = DEVKIT_PORT


class DisconnectBridge(msgspec.Struct, frozen=True, tag=True):
    """Close that connection, or stop trying to connect."""


class SetCamera(msgspec.Struct, frozen=True, tag=True):
    """Let the simulator render a scene camera for this client and send `Rendered` images; `camera` None: stop.

    `camera`: a name of `Scene.scene_cameras`, `Orbit` or `Fly`. `vehicle` to follow, None: the first vehicle. `height`
    [m] of the Bird's Eye; `azimuth`, `elevation` [rad] and `distance` [m] place the orbit around the vehicle. Fly is at
    `position` [m] in the map, and looks along `azimuth` (0: the x axis, left positive) and `elevation` (up positive).
    `zoom` multiplies the focal length. `drawings` of programs, collision `shapes`, and `axes` of vehicles and sensors
    are drawn into the image, and contact forces if `force_scale` is more than 0: the force of an arrow of 10 cm [N].
    """

    camera: Name | None
    vehicle: Name | None = None
    height: float = 3.0
    azimuth: float = 0.0
    elevation: float = 0.5
    distance: float = 1.0
    zoom: float = 1.0
    width: int = 960
    rate: float = 30.0
    position: Vector = (0.0, 0.0, 1.0)
    drawings: bool = False
    shapes: bool = False
    axes: bool = False
    force_scale: float = 0.0


class ViewSensor(msgspec.Struct, frozen=True, tag=True):
    """Let the simulator render the depth or the labels of what a sensor camera sees, and send `SensorView`s.

    `camera` None: stop. `vehicle` None: the first one. `farthest`: depth at which the colours end [m]. `width` in
    pixels, at most that of the camera; `rate` [Hz] in wall time. The distortion of the lens is left out. The camera
    itself, and its images, do not change.
    """

    camera: Name | None
    vehicle: Name | None = None
    content: Literal["depth", "labels"] = "depth"
    farthest: float = 10.0
    width: int = 320
    rate: float = 5.0


class LetDrive(msgspec.Struct, frozen=True, tag=True):
    """Let the driver that is included in the simulator drive a vehicle, or give the vehicle back to the person.

    The vehicle is in autonomous mode meanwhile. The driver ends with `SetDrivingMode`, a `Reset` or another scenario.
    """

    vehicle: Name
    is_on: bool = True


class DescribeWeather(msgspec.Struct, frozen=True, tag=True):
    """What the present weather means in numbers: the `text` of the Response, as `autodrive weather` prints it."""


class DescribeVehicle(msgspec.Struct, frozen=True, tag=True):
    """The URDF of a vehicle as it is now, with the poses of its sensors: the `text` of the Response.

    Its meshes are files of the ROS package autodrive_description, which has those of the shipped vehicles.
    """

    vehicle: Name


ServerOperation: TypeAlias = (
    Operation
    | ConnectBridge
    | DisconnectBridge
    | SetCamera
    | ViewSensor
    | LetDrive
    | DescribeWeather
    | DescribeVehicle
    | RecordingOperation
    | FileOperation
)
"""All operations that a client can request."""


class Request(msgspec.Struct, frozen=True, tag=True):
    """Requests an operation; the `Response` or `Error` has the same `id`."""

    id: int
    operation: ServerOperation
    heard: float | None = None
    """`clock` of the latest Status that the client had. A request is refused that arrives more than 4 s after that
    Status was sent: its sender may have given it up. None: the age of the request does not matter."""


ClientMessage: TypeAlias = Hello | Subscribe | Drive | Release | Request

# -- from the server --------------------------------------------------------------------------------------------


class Starting(msgspec.Struct, frozen=True, tag=True):
    """Sent several times a second, before the Welcome, while the server makes its world: what it does.

    `share`: of the stage that is done, 0 to 1. `remaining`: estimated time until its end [s]. None: not known.
    `scene`, `frame`: the world at its start, for a picture until it runs; only in one message, as soon as it is known.
    `scenario`: name of the scenario that is loaded. `has_start_screen`: as in the Welcome.
    """

    stage: str
    share: float | None = None
    remaining: float | None = None
    scene: Scene | None = None
    frame: Frame | None = None
    scenario: str = ""
    has_start_screen: bool = False


class RunOrigin(msgspec.Struct, frozen=True):
    """The run that a simulator belongs to.

    `id`: random; no other run has it. `user`: login name of who started it. `started`: when, in seconds since 1970 UTC.
    """

    id: str
    user: str
    started: float


class Welcome(msgspec.Struct, frozen=True, tag=True):
    """The answer to the Hello: versions, the display name of the client, and the scenarios that can be loaded.

    `folder`: name of the folder with files of the user, see `ListFiles`; empty: there is none. `run`: the run that the
    simulator belongs to; None: an older simulator, which does not say. `title`: of the present scenario.
    `has_start_screen`: the simulator was started without a scenario, and nobody has loaded one yet: a page offers them.
    """

    protocol: int
    version: str
    name: str
    scenarios: dict[str, str]
    """Name -> title."""
    folder: str = ""
    run: RunOrigin | None = None
    title: str = ""
    has_start_screen: bool = False


class Lamp(msgspec.Struct, frozen=True):
    """A lamp of a vehicle: position in the vehicle frame [m], linear RGB, range of its light [m]."""

    position: Vector
    color: Vector
    range: float


class SensorScene(msgspec.Struct, frozen=True):
    """Settings of a sensor or camera, as `SetSensor` changes them."""

    is_on: bool
    rate: float | None
    """[Hz]; None: one sample per tick."""
    noise: str
    noises: list[str]
    """The values of `noise` that this sensor can have."""
    is_camera: bool


class VehicleScene(msgspec.Struct, frozen=True):
    """What a client needs to draw a vehicle. `model`: address of its .glb, relative to the page."""

    type: str
    model: str
    half_length: float
    """Largest half-extent [m]."""
    steering_limit: float
    """[rad]."""
    lamps: dict[str, Lamp]
    """Lamps by their names in `actuators.lights.LAMPS`."""
    cameras: list[str]
    """Names of the sensor cameras that are on."""
    lidar: Pose | None
    """Pose of the axes of the scan in the vehicle frame; None if there is no LIDAR or it is off."""
    wheelbase: float
    """[m]."""
    wheel_radius: float
    """[m]."""
    speed_limit: float
    """Circumferential speed of the driven wheels at full throttle [m/s]."""
    sensor_noise: dict[str, float]
    """Standard deviation of a sample with its offset, by quantity and in its unit: 'encoder_angle' [rad], 'ips' [m],
    'imu_orientation' [rad], 'imu_angular_velocity' [rad/s], 'imu_linear_acceleration' [m/s^2]; 0: exact."""
    size: Vector = (0.0, 0.0, 0.0)
    """Overall length, width, height [m]; the middle is half the wheelbase ahead of the origin."""
    is_traffic: bool = False
    """Whether it is a vehicle of the traffic, see `VehicleFrame`."""
    sensors: dict[str, SensorScene] = {}
    """Sensors and cameras, also those that are off, by name."""
    missing_gravity: float = 9.81
    """Acceleration upward that the IMU leaves out [m/s^2]; 0: it measures the specific force, as an accelerometer."""
    is_lidar_level: bool = False
    """Whether the rays of the LIDAR stay horizontal and follow only its heading."""


class Plan(msgspec.Struct, frozen=True):
    """A drawing of the map from above, with walls and lanes; x to the right, y up.

    `image`: address of the SVG file, relative to the page. `bounds` [m]: least x and y, greatest x and y.
    """

    image: str
    bounds: tuple[float, float, float, float]


class MapPort(msgspec.Struct, frozen=True):
    """A port of a module: a pose x, y [m], yaw [rad] that faces outward, and the width of its road [m].

    `state` in a map: 'joined' to another port; 'open': it may stay unconnected; 'free': it is not connected yet;
    'wrong': a port near it does not fit. In a module: 'free'.
    """

    x: float
    y: float
    yaw: float
    width: float
    state: Literal["joined", "open", "free", "wrong"] = "free"


class ModuleScene(msgspec.Struct, frozen=True):
    """A module that a map can have. `image`: address of its drawing from above (SVG), relative to the page."""

    title: str
    type: str
    """'road', 'intersection', 'parking', 'terrain' or 'obstruction'."""
    length: float
    """Length of the footprint along x [m]."""
    width: float
    """Along y [m]."""
    image: str
    ports: dict[str, MapPort]
    """Ports by name, in the axes of the module, without the blind ones."""


class MapProblem(msgspec.Struct, frozen=True):
    """What is wrong with the map, where [m], and which parts it concerns.

    `repair`: parts with which an `EditMap` repairs it; empty if that is not known.
    """

    kind: str
    """'unconnected', 'apart', 'turned' and 'width' of ports; 'overlap' of modules; 'blocked': a part is on a lane.
    Of a track: 'bend', 'touch', 'narrow'. Advice: 'unreachable': no car reaches or leaves a lane; 'outside': a vehicle
    stood beside the drivable area at x, y."""
    text: str
    x: float
    y: float
    parts: list[str]
    repair: dict[str, MapPart]
    vehicle: str = ""
    """The vehicle that is outside, for the kind 'outside'."""
    place: tuple[float, float, float] | None = None
    """Where the vehicle could stand on the nearest lane: x, y [m], yaw [rad]; None: there is no lane."""


class MapScene(msgspec.Struct, frozen=True):
    """The map as `EditMap` changes it."""

    parts: dict[str, MapPart]
    """Parts of the map by name."""
    ports: dict[str, dict[str, MapPort]]
    """Ports, in the map, of the modules among the parts: by part, then by port."""
    problems: list[MapProblem]
    modules: dict[str, ModuleScene]
    """Modules that can be placed, by name."""
    props: list[str]
    """Kinds of signs and traffic lights."""
    templates: dict[str, str]
    """Maps for `UseMap`: name -> title."""
    advice: list[MapProblem] = []
    """What may be as it is, but is hardly meant."""
    faces: dict[str, str] = {}
    """Addresses of the pictures of `props` (SVG), by kind."""


class TrackScene(msgspec.Struct, frozen=True):
    """The race track as `EditTrack` changes it."""

    line: TrackLine
    is_exact: bool
    """False: the track has a centre line and walls of its own; `line` is a line by points near it."""
    problems: list[MapProblem]
    templates: dict[str, str] = {}
    """Maps for `UseMap`: name -> title."""


class Scene(msgspec.Struct, frozen=True, tag=True):
    """What a client needs to draw the world; sent after the Welcome, and before the Frames of another World.

    Another scenario has another World, and so has an edit that does not only move things.
    """

    scenario: str
    title: str
    map: str
    tick: float
    """Simulated time of a tick [s]."""
    model: str
    """Address of the map's .glb, relative to the page."""
    vehicles: dict[str, VehicleScene]
    objects: dict[str, str]
    """Movable object -> address of its .glb."""
    light_table: dict[str, Any]
    """`render.look.light_table`."""
    scene_cameras: dict[str, dict[str, Any]]
    """`render.viewpoints.scene_cameras`."""
    label_colours: dict[str, str] = {}
    """Colours of a `SensorView`: '#rrggbb' by name of the label."""
    object_sizes: dict[str, Vector] = {}
    """Length, width and height [m] of each movable object."""
    plan: Plan | None = None
    """Drawing of the map."""
    warm_up_laps: int = 0
    """Laps of the race that are driven first and do not count."""
    timeline: Timeline | None = None
    """The recording that is shown; None: this is a simulation."""
    map_scene: MapScene | None = None
    """The map as it can be edited; None if it is a race track."""
    ground: list[str] = []
    """Addresses of more .glb files of the map, if it is being built: parts of its ground, with the textures of `model`.
    The parts that an edit did not change keep their addresses."""
    track_scene: TrackScene | None = None
    """The map as it can be edited if it is a race track."""


class Episode(msgspec.Struct, frozen=True):
    """The episode of an environment that is shown, and how the cars have fared in those before it."""

    task: str
    number: int
    """The first episode is 1."""
    cars: dict[str, CarState]
    """What each car does in this episode."""
    gap: float | None = None
    """How far the first car is ahead of the second one along the track [m]; None: it is no race."""
    succeeded: int = 0
    """Cars that succeeded in the episodes before, each counted once in each episode."""
    ended: int = 0
    """All cars of the episodes before, each counted once in each episode."""


class BridgeStatus(msgspec.Struct, frozen=True):
    """State of the connection to a devkit script; `error` is the reason why there is none."""

    address: str = f"127.0.0.1:{DEVKIT_PORT}"
    state: Literal["closed", "connecting", "connected"] = "closed"
    error: str = ""
    telemetry_rate: float = 0.0
    """Messages sent per second of wall time [Hz]."""
    command_rate: float = 0.0
    """Messages received per second of wall time [Hz]."""
    round_trip: float | None = None
    """Median time from a telemetry message to the next command [s]."""
    devkit: str = ""
    """Devkit generation of the script, keys, formats and signs in one line; empty before they are known."""
    note: str = ""
    """What the user should know about that choice; empty if it is certain."""


class Status(msgspec.Struct, frozen=True, tag=True):
    """State of the simulation; sent four times a second, and at once when a setting changes."""

    is_paused: bool
    speed: float | None
    """Requested simulated seconds per wall second; None: as fast as possible."""
    real_time_factor: float
    late_ticks: int
    clients: int
    drivers: dict[str, str]
    """Vehicle -> name of the client that drives it. Vehicles without a driver are omitted."""
    bridge: BridgeStatus
    cameras_error: str = ""
    """Why the cameras failed; empty if they did not, or if no client wants pictures."""
    note: str = ""
    """A long operation in progress, for example the loading of a scenario."""
    undo: str = ""
    """The edit that an `Undo` reverts, for example 'place V1'; empty: none."""
    redo: str = ""
    """The edit that a `Redo` makes again; empty: none."""
    error: str = ""
    """Why the physics cannot continue and the simulation is paused; empty if it can. A Reset clears it."""
    recording: RecordingStatus = RecordingStatus()
    """The recording that this simulator makes."""
    position: float | None = None
    """Time of the recording that is shown [s]; None: this is a simulation."""
    change: str = ""
    """The latest change of what all clients share, and which client made it: 'page 2 has changed the weather'."""
    changes: int = 0
    """Number of such changes, so that the same one again is seen."""
    clock: float = 0.0
    """Time of the server's steady clock at which this message was made [s]; see `Request.heard`."""
    refused: dict[str, str] = {}
    """Operations that clients may not request now, with the reason, by the name of the operation, such as 'Reset'."""
    cameras_note: str = ""
    """Why there are no pictures although nothing failed; empty if there are, or if no client wants any."""
    episode: Episode | None = None
    """The episode of an environment; None: this is none."""


class Scan(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A new LIDAR scan; sent before the first Frame that it belongs to."""

    vehicle: str
    scan: LidarScan


class Drawn(msgspec.Struct, frozen=True, tag=True):
    """A drawing of that name; it is shown before the simulated time `until` [s]. None: it was removed."""

    name: str
    drawing: Drawing | None
    until: float


class Ways(msgspec.Struct, frozen=True, tag=True):
    """Where the vehicles were between two Frames, ten times in a simulated second; sent before the second Frame.

    `times` [s], shape (n,). `positions` [m] by vehicle, as in `Pose`, one after the other, shape (3 n,).
    """

    times: Array
    positions: dict[str, Array]


class CollisionShapes(msgspec.Struct, frozen=True, gc=False):
    """Shapes in the frame of their body, or in the map if they are fixed; arrays row after row.

    `kind` int64, shape (n,): 2 sphere, 5 cylinder, 6 box. `size` [m], shape (n, 3): radius; radius and half height
    (axis z); half sizes. `position` of the centre [m], shape (n, 3); `rotation`: its matrix, row-major, shape (n, 9).
    """

    kind: NDArray[np.int64]
    size: Array
    position: Array
    rotation: Array


class Shapes(msgspec.Struct, frozen=True, tag=True):
    """Collision shapes by vehicle and object, the fixed ones, and sensors in the frame of their vehicle.

    Sent once after each Scene.
    """

    bodies: dict[str, CollisionShapes]
    fixed: CollisionShapes
    sensors: dict[str, dict[str, Pose]]


class ContactForces(msgspec.Struct, frozen=True, gc=False):
    """Forces on a vehicle, each with the part: the name of a wheel, or of what the body of the vehicle touches.

    `position` [m] and `force` [N], in the vehicle frame, row after row, shape (n, 3). Force of the ground on a wheel at
    the end of the tick, as if the ground were level; mean over the tick of all contacts with another body.
    """

    parts: tuple[str, ...]
    position: Array
    force: Array


class Contacts(msgspec.Struct, frozen=True, tag=True):
    """Contact forces of each vehicle, of the latest tick; sent before a Frame."""

    vehicles: dict[str, ContactForces]


class Picture(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A new image of a sensor camera as JPEG; sent before the first Frame that it belongs to."""

    vehicle: str
    camera: str
    time: float
    pose: Pose
    """Map from optical frame."""
    intrinsics: CameraIntrinsics
    """Intrinsics of the full image; the JPEG has the subscribed `picture_width`."""
    jpeg: bytes


class Rendered(msgspec.Struct, frozen=True, tag=True, gc=False):
    """An image of the scene camera that was set with `SetCamera`, at that simulated time [s]."""

    time: float
    jpeg: bytes


class SensorView(msgspec.Struct, frozen=True, tag=True, gc=False):
    """What was requested with `ViewSensor`, at that simulated time [s].

    Depth has the colours of turbo from 0 to `farthest`, black beyond the last surface; labels those of
    `Scene.label_colours`.
    """

    time: float
    jpeg: bytes


class Response(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A request succeeded; `frame` is the Frame after it, with all events since the last Frame sent.

    `text`: the scenario or map as YAML, for a `SaveScenario` or `SaveMap`; the path of the file, for a `StopRecording`
    or `SaveRecording`; the name of the file, for a `SaveFile`; warnings, for an edit or an `ImportTrack`. `files`: by
    name, for a `ListFiles`. `picture`: a PNG, for an `ExportMap`, whose YAML file is the `text`.
    `curves`: by plot, for a `PlotRecording`; `text` says whether the recording is still being read.
    """

    id: int
    frame: Frame
    text: str = ""
    curves: dict[str, Curve] = {}
    files: dict[str, OwnFile] = {}
    picture: bytes = b""


class Error(msgspec.Struct, frozen=True, tag=True, gc=False):
    """A message or request failed; `text` says why and how to correct it. `id`: the request, None for other messages.

    `code`: 'version' (of the Hello), 'message' (not understood), 'request' (refused), 'taken' (another client drives
    the vehicle), 'mode' (the vehicle obeys the other source), 'rate' (too many messages or clients).
    """

    code: Literal["version", "message", "request", "taken", "mode", "rate"]
    text: str
    id: int | None = None


ServerMessage: TypeAlias = (
    Starting
    | Welcome
    | Scene
    | Shapes
    | Status
    | Scan
    | Drawn
    | Ways
    | Contacts
    | Picture
    | Rendered
    | SensorView
    | Response
    | Error
    | Frame
)
"""A streamed Frame has no scans and images, which are messages of their own, and all events since the last one sent."""
