"""Messages: Command, Operation, Frame, Event and the sensor readings; the single definition for all languages.

Units are SI and radians. Axes are x forward, y left, z up (REP 103); left turns are positive. Quaternions are
wxyz. Arrays are read-only float64 numpy arrays unless stated otherwise. Every reading has the simulated time of its
measurement. `gc=False`: these structs cannot be part of a reference cycle, so the garbage collector skips them.
"""

from __future__ import annotations

import enum
from typing import TYPE_CHECKING, Annotated, Any, Literal, NoReturn, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import ArrayShape, read_only
from autodrive.base.errors import NoImageError
from autodrive.base.png import encode_png
from autodrive.base.suggest import check_keywords
from autodrive.protocol import display
from autodrive.protocol.display import Displayed

Array: TypeAlias = NDArray[np.float64]
Vector2: TypeAlias = Annotated[Array, ArrayShape(2)]
Vector3: TypeAlias = Annotated[Array, ArrayShape(3)]
Quaternion: TypeAlias = Annotated[Array, ArrayShape(4, is_quaternion=True)]
WheelArray: TypeAlias = Annotated[Array, ArrayShape(4)]


class Headlights(enum.IntEnum):
    """Front lamps: off, low beam (lamp 1 of each side), high beam (lamps 1 and 2). Report, section 3.1.4."""

    OFF = 0
    LOW = 1
    HIGH = 2


class Indicators(enum.IntEnum):
    """Turning indicators: off, left, right, hazard (both). Report, section 3.1.4."""

    OFF = 0
    LEFT = 1
    RIGHT = 2
    HAZARD = 3


class TailLights(enum.IntEnum):
    """Rear red lamps: off, partial (with headlights), bright (brakes applied). Report, section 3.1.4."""

    OFF = 0
    PARTIAL = 1
    BRIGHT = 2


class TrafficLightState(enum.IntEnum):
    """What a traffic light shows; the numbers are those of the devkit."""

    OFF = 0
    RED = 1
    YELLOW = 2
    GREEN = 3


class RaceStatus(enum.IntEnum):
    """A vehicle in a race: it waits for the start, races, has finished, is disqualified, or has retired."""

    WAITING = 0
    RACING = 1
    FINISHED = 2
    DISQUALIFIED = 3
    RETIRED = 4


# -- messages in ------------------------------------------------------------------------------------------------

Name: TypeAlias = Annotated[str, msgspec.Meta(max_length=100)]
"""A name; the length is checked when a message is decoded, as all limits below."""

Coordinate: TypeAlias = Annotated[float, msgspec.Meta(ge=-1e4, le=1e4)]
"""A coordinate [m] or heading [rad] in the map frame."""


class _Suggesting(type(msgspec.Struct)):
    """Makes the error of an unknown keyword argument say which there are."""

    if not TYPE_CHECKING:

        def __call__(cls, *args: Any, **kwargs: Any) -> Any:
            try:
                return super().__call__(*args, **kwargs)
            except TypeError:
                check_keywords(cls.__name__, kwargs, [*cls.__struct_fields__])
                raise


class Command(msgspec.Struct, frozen=True, gc=False, metaclass=_Suggesting):
    """Command of a driver for one vehicle.

    `throttle` [-1, 1]: fraction of the drive limit, forward positive; 0 brakes. `steering` [-1, 1]: fraction of
    the steering limit, left positive. Both are clamped. `headlights`, `indicators`: None keeps their state.
    """

    throttle: float = 0.0
    steering: float = 0.0
    headlights: Headlights | None = None
    indicators: Indicators | None = None


class Reset(msgspec.Struct, frozen=True, tag=True):
    """Restore the initial state of the world; `seed` None keeps the seed."""

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)] | None = None


class Pause(msgspec.Struct, frozen=True, tag=True):
    """Stop simulated time; clients stay connected."""


class Resume(msgspec.Struct, frozen=True, tag=True):
    """Continue simulated time."""


class Step(msgspec.Struct, frozen=True, tag=True):
    """Run `ticks` ticks while paused, the first of them with these commands, by vehicle.

    The commands of a Step apply in every driving mode. In a replay: show a Frame `ticks` later, or earlier if negative.
    """

    ticks: int = 1
    commands: dict[Name, Command] = {}


class SetSpeed(msgspec.Struct, frozen=True, tag=True):
    """Simulated seconds per wall second; None: as fast as possible."""

    factor: float | None = 1.0


class Seek(msgspec.Struct, frozen=True, tag=True):
    """Show that time of the recording [s]; a simulation refuses it."""

    time: Annotated[float, msgspec.Meta(ge=0.0)]


class Teleport(msgspec.Struct, frozen=True, tag=True):
    """Place a vehicle, at rest, at x, y [m] in the map frame with heading yaw [rad], until a Reset.

    `vehicle` may also be the name of a movable object.
    """

    vehicle: Name
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0


class Hold(msgspec.Struct, frozen=True, tag=True):
    """Hold a vehicle at a pose in the map frame, against all forces, from the next tick on: another program moves it.

    `position` [m] of the rear axle centre; None ends the hold. `orientation`: quaternion wxyz of any length.
    """

    vehicle: Name
    position: tuple[Coordinate, Coordinate, Coordinate] | None
    orientation: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


class SetSceneLight(msgspec.Struct, frozen=True, tag=True):
    """Day (True) or night (False); ends a time of day."""

    enabled: bool


class SetTimeOfDay(msgspec.Struct, frozen=True, tag=True):
    """Let sun and sky follow a time of day.

    `time`: since midnight [s]; None keeps it (noon if none is set). `scale`: seconds of the day per simulated second.
    """

    time: Annotated[float, msgspec.Meta(ge=-1e9, le=1e9)] | None
    scale: Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)] = 0.0


Share: TypeAlias = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
"""A share from nothing (0) to the greatest amount (1)."""


class Weather(Displayed, frozen=True, gc=False):
    """Weather, and the state of the ground; the default is a clear sky over dry ground.

    `wetness` and `snow_cover` of the ground: None lets them follow rain and snow, a number holds them. A Frame has
    their values. See `docs/weather.md` for the amounts in units of physics.
    """

    clouds: Share = 0.0
    fog: Share = 0.0
    rain: Share = 0.0
    snow: Share = 0.0
    wind: Share = 0.0
    wetness: Share | None = None
    snow_cover: Share | None = None


class WeatherEffects(Displayed, frozen=True, gc=False):
    """What the weather of a Frame means for its first vehicle.

    `grip`: factor of the friction of its tyres. `sight` [m] infinite in clear air. `lidar_dark`, `lidar_bright`: range
    of its LIDAR at a reflectivity of 10 % and of 80 % [m]; None without a LIDAR.
    """

    grip: float
    sight: float
    lidar_dark: float | None
    lidar_bright: float | None


class SetWeather(msgspec.Struct, frozen=True, tag=True):
    """Set the weather, all of it: what `weather` leaves out is none. The ground follows with its time constants.

    `keeps_ground`: what `weather` does not say of wetness and snow cover stays as it is: held, or following.
    """

    weather: Weather = Weather()
    keeps_ground: bool = False


MAX_POINTS = 2000
"""Most points of a drawing."""
MAX_DRAWINGS = 1000
"""Most drawings of a request."""


class Drawing(msgspec.Struct, frozen=True):
    """Points, lines or a text in the view, not in the images of sensors. See `DrawCalls`.

    `points` x, y, z [m] in the map frame. 'path': a line through all; 'lines': one between each pair; 'text': its
    middle. `color`: red, green, blue and opacity, 0 to 1, sRGB. `size` [m]: diameter of points, width of lines, height
    of a text. `lifetime`: simulated time after which it disappears [s]; None: it stays.
    """

    kind: Literal["points", "path", "lines", "text"]
    points: Annotated[
        tuple[tuple[Coordinate, Coordinate, Coordinate], ...], msgspec.Meta(min_length=1, max_length=MAX_POINTS)
    ]
    text: Annotated[str, msgspec.Meta(max_length=200)] = ""
    color: tuple[Share, Share, Share, Share] = (1.0, 0.58, 0.0, 1.0)
    size: float = 0.02
    lifetime: float | None = None


class Draw(msgspec.Struct, frozen=True, tag=True):
    """Draw, replace or remove (None) drawings, by name; `clears`: remove all others. A reset removes all."""

    drawings: Annotated[dict[Name, Drawing | None], msgspec.Meta(max_length=MAX_DRAWINGS)]
    clears: bool = False


class SetTrafficLight(msgspec.Struct, frozen=True, tag=True):
    """Let a traffic light show that state until a Reset; None: what its program says, or nothing without a program."""

    light: Name
    state: TrafficLightState | None


class SetDrivingMode(msgspec.Struct, frozen=True, tag=True):
    """Set the source of commands of a vehicle: a person (manual; scripts are ignored) or a script (autonomous)."""

    vehicle: Name
    is_autonomous: bool


class Retire(msgspec.Struct, frozen=True, tag=True):
    """End the race of a vehicle, which retires or is disqualified; the reason is in its `RaceStatusChanged`."""

    vehicle: Name
    reason: Annotated[str, msgspec.Meta(max_length=200)] = ""
    is_disqualified: bool = False


class LoadScenario(msgspec.Struct, frozen=True, tag=True):
    """Load the scenario of that name; clients stay connected."""

    name: Annotated[str, msgspec.Meta(max_length=1000)]


# Edits change the scenario of the running world. Simulated time continues. All clients share one history of edits.


class Place(msgspec.Struct, frozen=True, tag=True):
    """Place a vehicle or a movable object, at rest, at x, y [m] on the ground with heading yaw [rad].

    As `Teleport`, but an edit: the scenario starts with it there, also after a `Reset`.
    """

    name: Name
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0


class AddBox(msgspec.Struct, frozen=True, tag=True):
    """Add a movable box on the ground at x, y [m] with heading yaw [rad]; length, width, height [m]; mass [kg]."""

    name: Name
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0
    size: tuple[float, float, float] = (0.1, 0.1, 0.1)
    mass: float = 0.1


class RemoveBox(msgspec.Struct, frozen=True, tag=True):
    """Remove a movable box, of the scenario or of its map."""

    name: Name


class SetSensor(msgspec.Struct, frozen=True, tag=True):
    """Switch a sensor or camera of a vehicle on or off, and set its sample rate [Hz] and noise.

    `sensor`: 'encoders', 'ips', 'imu', 'lidar', 'range', or the name of a camera. Off: no scans, ranges or images;
    encoders, IPS and IMU keep their reading. `rate` None: as in the vehicle's file. `noise`: 'ideal' (none), 'file' (as
    in the vehicle's file), 'realistic' (of the data sheet, if it has noise) or 'strong'; None: as in the scenario.
    """

    vehicle: Name
    sensor: Name
    is_on: bool = True
    rate: float | None = None
    noise: Literal["ideal", "file", "realistic", "strong"] | None = None


class MapModule(msgspec.Struct, frozen=True, tag=True):
    """A placed module: x, y [m] and heading yaw [rad] of the middle of its footprint.

    `module`: a name of `MapScene.modules`. `open`: ports that may stay unconnected; True: all. Terrain and boxes only:
    `length` and `width` [m]; None: as in the module's file. Boxes only: `height` [m], `mass` [kg], and `z` [m], the
    height of the underside above the ground.
    """

    module: Annotated[str, msgspec.Meta(max_length=1000)]
    x: Coordinate
    y: Coordinate
    yaw: Coordinate = 0.0
    open: bool | tuple[Name, ...] = False
    length: float | None = None
    width: float | None = None
    height: float | None = None
    z: float = 0.0
    mass: float | None = None


class MapWall(msgspec.Struct, frozen=True, tag=True):
    """A wall along a line through points x, y [m], from the last to the first if `is_closed`; thickness, height [m]."""

    points: tuple[tuple[Coordinate, Coordinate], ...]
    height: float
    thickness: float = 0.1
    is_closed: bool = False


class MapBlock(msgspec.Struct, frozen=True, tag=True):
    """A static box on the ground, such as a building: middle x, y [m], heading yaw [rad], sizes [m]."""

    x: Coordinate
    y: Coordinate
    length: float
    width: float
    height: float
    yaw: Coordinate = 0.0


class MapProp(msgspec.Struct, frozen=True, tag=True):
    """A traffic sign or traffic light at x, y [m] whose face looks along yaw [rad]; `kind`: one of `MapScene.props`."""

    kind: Name
    x: Coordinate
    y: Coordinate
    yaw: Coordinate


MapPart: TypeAlias = MapModule | MapWall | MapBlock | MapProp


class EditMap(msgspec.Struct, frozen=True, tag=True):
    """Add, replace or remove (None) parts of the map, by name. It is one edit, however many parts it has.

    `seen`: the parts as the client knows them; None: not there. If a part is different now, because another client has
    changed it, the edit is refused.
    """

    parts: Annotated[dict[Name, MapPart | None], msgspec.Meta(max_length=1000)]
    seen: Annotated[dict[Name, MapPart | None], msgspec.Meta(max_length=1000)] = {}


MAX_MODULES = 100
"""Own modules of a map that a client sends."""
MAX_TEXT = 2**20
"""Longest text or picture of a file in a message [characters or bytes]."""


class UseMap(msgspec.Struct, frozen=True, tag=True):
    """Replace the map by a map of the simulator, one of `MapScene.templates`, or by the `text` of a file (YAML).

    The text is that of a map or of a track.

    The modules of a text are those of `MapScene.modules`, and of `modules`: names in the text -> texts of their files.
    Its map is a draft, which may be unfinished.
    """

    name: Name = ""
    text: Annotated[str, msgspec.Meta(max_length=MAX_TEXT)] = ""
    modules: Annotated[
        dict[str, Annotated[str, msgspec.Meta(max_length=MAX_TEXT)]], msgspec.Meta(max_length=MAX_MODULES)
    ] = {}


class CloseLoop(msgspec.Struct, frozen=True, tag=True):
    """Close a road: add roads from an open end of the module `part` to an open end of the module `other`, as one edit.

    Without `port` or `other_port`, any open end of the module; without `other`, the nearest open end that can be
    reached. Without `part`, all open ends of the map: roads lead from one to another where they fit, and the ends that
    are left get the end of a road.
    """

    part: Name = ""
    port: Name = ""
    other: Name = ""
    other_port: Name = ""


class InsertModule(msgspec.Struct, frozen=True, tag=True):
    """Insert a module where the port `port` of the module `part` is joined with another one, as one edit.

    The road behind the joint is moved. A closed road is closed again by other roads, in another place or instead of
    some roads behind the joint. `entry`: the port of the new module at `port`; left out: one that fits.
    """

    module: Annotated[str, msgspec.Meta(max_length=1000)]
    part: Name
    port: Name
    entry: Name = ""


class RemoveTraffic(msgspec.Struct, frozen=True, tag=True):
    """Remove the traffic of the scenario: on some maps, and on race tracks, traffic cannot drive. Time starts anew."""


class TrackLine(msgspec.Struct, frozen=True):
    """A track by points x, y [m] of a smooth closed line, in driving direction; `width` between the barriers [m].

    The start line goes through the first point. `barrier`: what stands along the edges; a duct is an air duct.
    """

    points: Annotated[tuple[tuple[Coordinate, Coordinate], ...], msgspec.Meta(min_length=3, max_length=200)]
    width: float = 1.2
    barrier: Literal["wall", "duct"] = "wall"


class EditTrack(msgspec.Struct, frozen=True, tag=True):
    """Replace the map by a track by points, or change its track. Vehicles beside the new track go to its start.

    `seen`: the track as the client knows it. If it is different now, because another client has changed it, the edit
    is refused; None: the edit is made in any case.
    """

    track: TrackLine
    seen: TrackLine | None = None


class GenerateTrack(msgspec.Struct, frozen=True, tag=True):
    """Replace the map by a random track by points: the same for the same `seed`; about that length, and width [m]."""

    seed: Annotated[int, msgspec.Meta(ge=0, le=2**53)] = 0
    length: Annotated[float, msgspec.Meta(ge=15.0, le=100.0)] = 60.0
    width: Annotated[float, msgspec.Meta(ge=0.9, le=3.0)] = 1.2
    barrier: Literal["wall", "duct"] = "wall"


class Undo(msgspec.Struct, frozen=True, tag=True):
    """Revert the latest edit."""


class Redo(msgspec.Struct, frozen=True, tag=True):
    """Make the edit again that was reverted last."""


class SaveScenario(msgspec.Struct, frozen=True, tag=True):
    """Request the scenario with all edits, as YAML, in the `text` of the Response, with that title if there is one."""

    title: Annotated[str, msgspec.Meta(max_length=200)] = ""


class SaveMap(msgspec.Struct, frozen=True, tag=True):
    """Request the map with all edits, as YAML, in the `text` of the Response, with that title if there is one."""

    title: Annotated[str, msgspec.Meta(max_length=200)] = ""


Edit: TypeAlias = (
    Place
    | AddBox
    | RemoveBox
    | SetSensor
    | RemoveTraffic
    | EditMap
    | UseMap
    | CloseLoop
    | InsertModule
    | EditTrack
    | GenerateTrack
)

Operation: TypeAlias = (
    Reset
    | Pause
    | Resume
    | Step
    | SetSpeed
    | Seek
    | Teleport
    | Hold
    | SetSceneLight
    | SetTimeOfDay
    | SetWeather
    | Draw
    | SetTrafficLight
    | SetDrivingMode
    | Retire
    | LoadScenario
    | Edit
    | Undo
    | Redo
    | SaveScenario
    | SaveMap
)


# -- readings ---------------------------------------------------------------------------------------------------


class Pose(Displayed, frozen=True, gc=False):
    """Position [m], shape (3,), and orientation (quaternion wxyz), shape (4,), in the map frame."""

    position: Vector3
    orientation: Quaternion


class EncoderReading(Displayed, frozen=True, gc=False):
    """Rear wheels, left then right: `ticks` (int64, shape (2,)) and `angles` [rad], shape (2,); never wrap."""

    time: float
    ticks: Annotated[NDArray[np.int64], ArrayShape(2)]
    angles: Vector2


class IpsReading(Displayed, frozen=True, gc=False):
    """Position [m] of the rear axle centre in the map frame, shape (3,)."""

    time: float
    position: Vector3


class ImuReading(Displayed, frozen=True, gc=False):
    """Inertial data in the axes of the sensor (REP 103, REP 145).

    `orientation` wxyz, shape (4,); `euler` roll, pitch, yaw [rad] in (-pi, pi], shape (3,), with
    R = Rz(yaw) Ry(pitch) Rx(roll); `angular_velocity` [rad/s], shape (3,); `linear_acceleration` [m/s^2], shape
    (3,), without gravity unless the spec asks for specific force.
    """

    time: float
    orientation: Quaternion
    euler: Vector3
    angular_velocity: Vector3
    linear_acceleration: Vector3


class LidarScan(Displayed, frozen=True, gc=False):
    """One scan. Ray i has the angle angle_min + i * angle_increment [rad] in the axes of the sensor, left positive.

    `ranges` [m], shape (n_ray,), as in REP 117: -inf is below range_min, +inf is no return within range_max.
    `intensities`, shape (n_ray,). `time` is the time of the last ray; a rolling scan started `scan_time` earlier.
    `time_increment` [s] between rays is 0 for an instantaneous scan. `scan_rate` [Hz].
    """

    time: float
    ranges: Array
    intensities: Array
    angle_min: float
    angle_increment: float
    range_min: float
    range_max: float
    scan_rate: float
    scan_time: float
    time_increment: float

    def _repr_html_(self) -> str:
        """The scan seen from above, for a notebook."""
        return display.scan_svg(self)


class RangeReading(Displayed, frozen=True, gc=False):
    """Distance to the nearest object in the cone of a range sensor around the x axis of the sensor.

    `range` [m] as in REP 117: -inf is below range_min, +inf is no return within range_max. `field_of_view` [rad] is the
    full opening angle of the cone.
    """

    time: float
    range: float
    field_of_view: float
    range_min: float
    range_max: float
    radiation: Literal["ultrasound", "infrared"]


class OwnReading(Displayed, frozen=True, gc=False):
    """The reading of a sensor of the user: `values`, shape (n,), and the name of each in `columns`: 'distance [m]'.

    A value may be infinite or NaN.
    """

    time: float
    values: Array
    columns: tuple[str, ...]


class CameraIntrinsics(Displayed, frozen=True, gc=False):
    """The pinhole model of a camera, in pixels.

    A point (x, y, z) in the optical frame is at u = cx + fx x / z, v = cy + fy y / z, from the upper left corner of
    the image; pixel (0, 0) covers 0 to 1 in both. `distortion` k1, k2, p1, p2, k3 is applied to x / z and y / z first
    (Brown-Conrady, same as OpenCV and ROS 'plumb_bob').
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def matrix(self) -> Array:
        """Camera matrix K of OpenCV and ROS, shape (3, 3): the centre of the upper left pixel is at (0, 0) there."""
        return np.array([[self.fx, 0.0, self.cx - 0.5], [0.0, self.fy, self.cy - 0.5], [0.0, 0.0, 1.0]])

    def resized(self, width: int, height: int) -> CameraIntrinsics:
        """The intrinsics of the same image in another size [pixels], such as that of a client's picture."""
        across, down = width / self.width, height / self.height
        return CameraIntrinsics(
            width, height, across * self.fx, down * self.fy, across * self.cx, down * self.cy, self.distortion
        )


class CameraImage(Displayed, frozen=True, gc=False):
    """One image, taken at `time` [s].

    `pose` is the pose of the optical frame (x right, y down, z forward, REP 103) in the map frame. `rgba`
    uint8, shape (height, width, 4), C-contiguous, first row on top, sRGB; alpha is 255. If configured: `depth` [m]
    float32, shape (height, width), along z of the optical frame, inf for no surface; `labels` uint8, same shape, see
    `autodrive.graphics.assets.asset.Label`; `instances` uint16, same shape, the number of the object that the pixel
    shows, see `World.instances`, 0 for none.
    """

    time: float
    pose: Pose
    intrinsics: CameraIntrinsics
    rgba: NDArray[np.uint8]
    depth: NDArray[np.float32] | None = None
    labels: NDArray[np.uint8] | None = None
    instances: NDArray[np.uint16] | None = None

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """The image without alpha, shape (height, width, 3), C-contiguous as OpenCV needs it; a new array each time."""
        channels = [self.rgba[..., channel] for channel in range(3)]  # five times as fast as a copy of the slice
        return read_only(np.stack(channels, axis=2))

    def _repr_html_(self) -> None:
        """Nothing, so that a notebook shows the image."""

    def _repr_png_(self) -> bytes:
        """The image, for a notebook."""
        return encode_png(self.rgb)


class Images(dict[str, CameraImage]):
    """The latest image of each camera, by its name. A camera without an image raises `NoImageError`, a `KeyError`."""

    def __missing__(self, camera: str) -> NoReturn:
        if self:
            raise NoImageError(f"there is no image of camera '{camera}'; there are images of {', '.join(self)}")
        raise NoImageError(
            f"there is no image of camera '{camera}': the cameras are off, or the first image is not ready. To switch "
            "them on: autodrive.make(..., cameras=True), or 'autodrive run --cameras'. With an autodrive.Client: "
            "Client(picture_rate=10) and client.image(vehicle, camera)"
        )


class Lights(Displayed, frozen=True, gc=False):
    """State of the lamps. `left_indicator` and `right_indicator`: whether the blinking lamp is lit now."""

    headlights: Headlights
    indicators: Indicators
    tail_lights: TailLights
    left_indicator: bool
    right_indicator: bool
    reverse_lights: bool


WHEEL_NAMES = ("front_left", "front_right", "rear_left", "rear_right")
"""Order of the wheels in all arrays."""


class WheelsReading(Displayed, frozen=True, gc=False):
    """Ground truth of the wheels, shape (4,) each, in the order of `WHEEL_NAMES`.

    `steering_angle` [rad], `rotation_angle` [rad], `angular_velocity` [rad/s], `compression` [m] of the suspension
    (0 at the target position), `normal_load` [N], `slip_ratio` and `slip_angle` [rad].
    """

    steering_angle: WheelArray
    rotation_angle: WheelArray
    angular_velocity: WheelArray
    compression: WheelArray
    normal_load: WheelArray
    slip_ratio: WheelArray
    slip_angle: WheelArray


class RaceState(Displayed, frozen=True, gc=False):
    """A vehicle in a race, ground truth. Times are in simulated seconds.

    `lap_count` completed laps of `lap_total`, with warm-up laps (0: without limit); `lap_time` in the present lap;
    `last_lap_time`, and `best_lap_time` of the laps that count, are infinite until there is one. `race_time` of the
    laps that count, so far, without `penalty` [s]. `collision_count` of the collisions that the rules count.
    `checkpoint`: number of the checkpoint passed last in this lap, 0 before the first one. `distance` [m] along the
    track since the start line; `rank` from 1; `gap` to the first vehicle [s].
    """

    status: RaceStatus
    lap_count: int
    lap_total: int
    lap_time: float
    last_lap_time: float
    best_lap_time: float
    race_time: float
    penalty: float
    collision_count: int
    checkpoint: int
    distance: float
    rank: int
    gap: float
    is_wrong_way: bool


class HeardVehicle(Displayed, frozen=True, gc=False):
    """The latest radio message of another vehicle: what it was at `sent` [s]; the message arrived at `received` [s].

    `position` [m], shape (3,), in the map frame, with the noise of the channel; `yaw` [rad]; `speed` [m/s], negative in
    reverse; `steering` [rad], left positive.
    """

    sent: float
    received: float
    position: Vector3
    yaw: float
    speed: float
    steering: float
    lights: Lights


class HeardLight(Displayed, frozen=True, gc=False):
    """The latest radio message of a traffic light: what it showed at `sent` [s]; it arrived at `received` [s].

    `time_to_change` [s] counts from `sent`; None: it is not known or does not change.
    """

    sent: float
    received: float
    state: TrafficLightState
    time_to_change: float | None


class V2xReading(Displayed, frozen=True, gc=False):
    """What a vehicle has heard by radio: the latest message of each vehicle and each traffic light, by name."""

    vehicles: dict[str, HeardVehicle]
    lights: dict[str, HeardLight]


class VehicleFrame(Displayed, frozen=True, gc=False):
    """One vehicle at the time of the Frame: ground truth, actuator feedback, and the latest reading of every sensor.

    `pose` is the pose of the vehicle frame (origin: centre of the rear axle at wheel-centre height). `velocity` [m/s]
    of its origin and `angular_velocity` [rad/s], shape (3,), are in vehicle axes. `throttle` [-1, 1] is the current
    command of the drive actuators; `steering` [rad], left positive, is the angle of the steering actuator (report,
    tables 2 and 3; sampled every tick). `lidar` is the latest scan, `range` the latest measurement of the range sensor;
    None without such a sensor. `cameras` holds the latest image of each camera by its name ('front', 'rear'); it is
    empty if cameras are off and before the first image, see `Images`. `race`: laps and times; None without a race.
    `own` holds the latest reading of each sensor of the user by its name, see `World.add_sensor`. `v2x`: what it has
    heard by radio; None without a channel in the scenario. `is_traffic`: it
    is one of the cars of `ScenarioSpec.traffic`, which drive themselves.
    """

    pose: Pose
    velocity: Vector3
    angular_velocity: Vector3
    throttle: float
    steering: float
    encoders: EncoderReading
    ips: IpsReading
    imu: ImuReading
    lidar: LidarScan | None
    lights: Lights
    wheels: WheelsReading
    is_autonomous: bool
    collision_count: int
    cameras: dict[str, CameraImage] = msgspec.field(default_factory=Images)
    range: RangeReading | None = None
    race: RaceState | None = None
    own: dict[str, OwnReading] = msgspec.field(default_factory=dict)
    v2x: V2xReading | None = None
    is_traffic: bool = False

    @property
    def speed(self) -> float:
        """Forward speed [m/s], negative in reverse."""
        return float(self.velocity[0])

    def __repr__(self) -> str:
        return display.vehicle_text(self)


class ObjectFrame(Displayed, frozen=True, gc=False):
    """A movable object, for example a construction box."""

    pose: Pose


class TrafficLightFrame(Displayed, frozen=True, gc=False):
    """A traffic light: what it shows, and the time until that changes [s]; None: it is not known or does not change.

    `mode`: 'program', 'flashing' (yellow, as its program says at night), 'set' (by a request), or 'off'.
    """

    state: TrafficLightState
    time_to_change: float | None
    mode: Literal["off", "program", "flashing", "set"]


# -- events -----------------------------------------------------------------------------------------------------


class _OfVehicle(Displayed, frozen=True):
    """What happened to a vehicle, at a simulated time [s]."""

    time: float
    vehicle: str


class Collision(_OfVehicle, frozen=True, tag=True):
    """First contact of a vehicle with another object, which it has not touched for 0.2 s.

    A wall of the map file, with all its parts, is one object. `other` is the name of the vehicle, box or part of the
    map; `impulse` [N s] is the magnitude of the contact impulse of the tick, `CollisionEnded` has that of the whole
    collision; `position` [m] is a contact point in the map frame, shape (3,).
    """

    other: str
    impulse: float
    position: Vector3


class CollisionEnded(_OfVehicle, frozen=True, tag=True):
    """A vehicle has not touched an object of a `Collision` for 0.2 s.

    `other` is that of the `Collision`; `impulse` [N s] is the sum of the magnitudes of the contact impulses of all
    ticks, `duration` [s] the time from the first to the last of these ticks.
    """

    other: str
    impulse: float
    duration: float


class OffRoad(_OfVehicle, frozen=True, tag=True):
    """The first wheel of a vehicle left the drivable area; `position` [m], shape (3,), is its rear axle centre."""

    position: Vector3


class BackOnRoad(_OfVehicle, frozen=True, tag=True):
    """All wheels of a vehicle are on the drivable area again."""

    position: Vector3


class RedLight(_OfVehicle, frozen=True, tag=True):
    """The front of a vehicle crossed the stop line of a traffic light at red.

    `position` [m], shape (3,), is the rear axle centre of the vehicle.
    """

    light: str
    position: Vector3


class StopSign(_OfVehicle, frozen=True, tag=True):
    """The front of a vehicle crossed the stop line of a stop sign, and the vehicle had not stopped before the line.

    `position` [m], shape (3,), is the rear axle centre of the vehicle.
    """

    sign: str
    position: Vector3


# Events of a race; `position` [m], shape (3,), is the rear axle centre at the end of the tick.


class CheckpointPassed(_OfVehicle, frozen=True, tag=True):
    """A vehicle passed a checkpoint at `time`, within the tick; `lap` from 1, `split` [s] since the start of the lap.

    `sector_time` [s] since the checkpoint that it passed before. The finish line is the last checkpoint.
    """

    lap: int
    checkpoint: int
    split: float
    sector_time: float
    position: Vector3


class LapCompleted(_OfVehicle, frozen=True, tag=True):
    """A vehicle completed a lap at `time`, within the tick; `lap` from 1. `is_counted`: not a warm-up lap."""

    lap: int
    lap_time: float
    is_counted: bool
    position: Vector3


class RacePenalty(_OfVehicle, frozen=True, tag=True):
    """The rules add `duration` [s] to the time of a vehicle."""

    reason: str
    duration: float
    position: Vector3


class SetBack(_OfVehicle, frozen=True, tag=True):
    """The rules set a vehicle back to a checkpoint, 0: the start line; `position` is that before."""

    checkpoint: int
    position: Vector3


class WrongWay(_OfVehicle, frozen=True, tag=True):
    """A vehicle drives against the direction of the track."""

    position: Vector3


class RaceStatusChanged(_OfVehicle, frozen=True, tag=True):
    """A vehicle started, finished, retired or was disqualified, for this reason."""

    status: RaceStatus
    reason: str
    position: Vector3


RaceEvent: TypeAlias = CheckpointPassed | LapCompleted | RacePenalty | SetBack | WrongWay | RaceStatusChanged

Event: TypeAlias = Collision | CollisionEnded | OffRoad | BackOnRoad | RedLight | StopSign | RaceEvent


class Frame(msgspec.Struct, frozen=True, gc=False, tag=True):
    """The world after a tick: `time` [s] since reset, number of ticks, vehicles and movable objects by name.

    `events` are the events of this tick, in order. `scene_light` is True by day. `time_of_day` is the time since
    midnight [s], None if the light is fixed. `weather` and `weather_effects` are None under a clear sky over dry
    ground. `traffic_lights` are those of the map, by name.
    """

    time: float
    tick: int
    vehicles: dict[str, VehicleFrame]
    objects: dict[str, ObjectFrame]
    events: tuple[Event, ...]
    scene_light: bool
    time_of_day: float | None = None
    weather: Weather | None = None
    weather_effects: WeatherEffects | None = None
    traffic_lights: dict[str, TrafficLightFrame] = {}

    def __repr__(self) -> str:
        return display.frame_text(self)

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any:
            raise display.unknown_attribute(self, name)

    def _repr_html_(self) -> str:
        return display.frame_html(self)
