"""Client: reads Frames of a running simulator, drives its vehicles and steps it from a Python script."""

from __future__ import annotations

import reprlib
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.base.arrays import read_only
from autodrive.base.errors import AutodriveError, CommandError
from autodrive.base.suggest import with_suggestions
from autodrive.connect.client.client_socket import Address
from autodrive.connect.client.connection import LOADING, Connection
from autodrive.connect.client.target import Target, default_target
from autodrive.connect.client.view import ClientView
from autodrive.protocol.commands import check_commands, check_weather
from autodrive.protocol.drawing import DrawCalls
from autodrive.protocol.messages import (
    AddBox,
    CloseLoop,
    Command,
    EditMap,
    EditTrack,
    Frame,
    GenerateTrack,
    Headlights,
    Indicators,
    InsertModule,
    LoadScenario,
    MapPart,
    Operation,
    Pause,
    Place,
    Redo,
    RemoveBox,
    RemoveTraffic,
    Reset,
    Resume,
    SaveMap,
    SaveScenario,
    SetDrivingMode,
    SetSceneLight,
    SetSensor,
    SetSpeed,
    SetTimeOfDay,
    SetTrafficLight,
    SetWeather,
    Step,
    Teleport,
    TrackLine,
    TrafficLightState,
    Undo,
    UseMap,
    Weather,
)
from autodrive.protocol.native import (
    ConnectBridge,
    DescribeVehicle,
    DisconnectBridge,
    Drive,
    Picture,
    Release,
    Scene,
    Status,
    Subscribe,
)
from autodrive.protocol.own_files import ImportTrack
from autodrive.protocol.ports import DEVKIT_PORT


class Client:
    """A connection to a running simulator: `with autodrive.Client() as sim: ...`. Use it in one thread only.

    - `address`: 'host:port', or the link that the simulator prints. `token`: access token if it is not in the link.
      None: the port `AUTODRIVE_PORT` of this machine if that environment variable is set, else the last run of this
      user in the current folder, else port 8730. The Client then prints to stderr what it is connected to, and raises
      `AutodriveError` if that is not this run, if `AUTODRIVE_PORT` and the run disagree, or if neither is there and the
      simulator belongs to another user.
    - `name`: display name of the driver; None: the file name of the script.
    - `frame_rate`: largest rate of Frames in wall time [Hz], None: each tick, 0: none. `scans`: whether to get scans.
    - `picture_rate`: largest rate of pictures of each camera in wall time [Hz], 0: none. `picture_width` [pixels],
      None: the width of the camera. `picture_quality` of the JPEG, 1 to 100.
    - `timeout`: longest wait for an answer or a Frame [s]; then `TimeoutError`.
    - `patience`: longest wait for a simulator that starts or restarts [s]; then `NoSimulatorError`, a
      `ConnectionError`.

    A refusal raises a `CommandError` with the simulator's text: of a request at once, of a `drive`, which does not wait
    for an answer, at the next call.
    """

    @with_suggestions
    def __init__(
        self,
        address: str | None = None,
        *,
        token: str | None = None,
        name: str | None = None,
        frame_rate: float | None = None,
        scans: bool = True,
        picture_rate: float = 0.0,
        picture_width: int | None = None,
        picture_quality: int = 75,
        timeout: float = 10.0,
        patience: float = 60.0,
    ) -> None:
        name = (Path(sys.argv[0]).name or "python") if name is None else name
        wanted = Subscribe(frame_rate, scans, picture_rate, picture_width, picture_quality)
        own_target = None if address is None else Target(Address.of(address, token))
        target = (lambda: own_target) if own_target else lambda: default_target(token)
        self.connection = Connection(target, name, wanted, timeout, patience)
        self.draw = DrawCalls(self.connection.request)
        """Draws points, lines and texts into the view of the page."""
        self._seen_updates = 0
        self._images: dict[tuple[str, str], tuple[Picture, NDArray[np.uint8]]] = {}
        if address is None:
            print(f"autodrive: connected to {self.simulator}", file=sys.stderr, flush=True)

    def close(self) -> None:
        """Disconnect; the simulation continues, or stays paused."""
        self.connection.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- reading ------------------------------------------------------------------------------------------------

    @property
    def frame(self) -> Frame:
        """The latest Frame, with all events since the previous Frame that was read."""
        self.connection.catch_up()
        if self.connection.view.frame is None:
            return self.wait()
        return self.connection.view.read()

    def wait(self, timeout: float | None = None) -> Frame:
        """Wait for a Frame that was not read yet; returns the latest."""
        self.connection.catch_up()
        self.connection.until(lambda: self.connection.view.is_new, timeout, "Frame")
        return self.connection.view.read()

    def frames(self, rate: float | None = None) -> Iterator[Frame]:
        """Yield each new Frame, without end; `rate`: largest rate in wall time [Hz], None: that of the Client.

        A slow consumer gets the latest Frame, with the events of the Frames that were skipped.
        """
        usual = self.connection.subscription
        if rate is not None:
            self.connection.subscribe(msgspec.structs.replace(usual, frame_rate=rate))
        try:
            while True:
                yield self.wait()
        finally:
            if rate is not None and not self.connection.is_closed:
                self.connection.subscribe(usual)

    @property
    def pictures(self) -> dict[tuple[str, str], Picture]:
        """The latest picture of each camera by (vehicle, camera), as JPEG; requires a `picture_rate`."""
        self.connection.catch_up()
        return dict(self.connection.view.pictures)

    def image(self, vehicle: str, camera: str) -> NDArray[np.uint8]:
        """The latest picture of that camera, uint8, shape (height, width, 3), sRGB; waits for the first."""
        if not self.connection.subscription.picture_rate:
            raise AutodriveError("no pictures are subscribed: create the Client with a picture_rate, for example 10")
        self.connection.catch_up()
        key = vehicle, camera
        self._check_camera(vehicle, camera)
        self.connection.until(
            lambda: key in self.connection.view.pictures, None, f"picture of camera '{camera}' of vehicle '{vehicle}'"
        )
        picture = self.connection.view.pictures[key]
        known = self._images.get(key)
        if known is None or known[0] is not picture:
            known = self._images[key] = picture, _decoded(picture.jpeg)
        return known[1]

    @property
    def status(self) -> Status:
        """The latest Status: pause, speed, real-time factor, drivers, bridge."""
        self.connection.catch_up()
        self.connection.until(lambda: self.connection.view.status is not None, None, "Status")
        assert self.connection.view.status is not None
        return self.connection.view.status

    @property
    def scene(self) -> Scene:
        """The current scenario: its name, map, tick [s] and vehicles."""
        self.connection.catch_up()
        self.connection.until(lambda: self.connection.view.scene is not None, None, "Scene")
        assert self.connection.view.scene is not None
        return self.connection.view.scene

    @property
    def scenarios(self) -> dict[str, str]:
        """Name -> title of the scenarios that `load_scenario` can load."""
        return dict(self.connection.view.welcome.scenarios) if self.connection.view.welcome else {}

    @property
    def simulator(self) -> str:
        """What the client is connected to: title of the scenario, address, and who started the simulator when."""
        return self.connection.simulator

    @property
    def name(self) -> str:
        """The display name: the wanted one, with a number if another client has it."""
        return self.connection.view.welcome.name if self.connection.view.welcome else self.connection.name

    def set_rates(self, frame_rate: float | None, picture_rate: float) -> None:
        """Change the rates of Frames and pictures; see `Client`."""
        wanted = msgspec.structs.replace(self.connection.subscription, frame_rate=frame_rate, picture_rate=picture_rate)
        if wanted != self.connection.subscription:
            self.connection.subscribe(wanted)

    def wait_news(self, timeout: float | None = None) -> ClientView:
        """Wait for a Frame, scan or picture that is newer than the last such call; returns all that was received."""
        view = self.connection.view
        self.connection.until(
            lambda: self.connection.view is not view or self.connection.view.update_count > self._seen_updates,
            timeout,
            "update",
        )
        self._seen_updates = self.connection.view.update_count
        return self.connection.view

    # -- driving ------------------------------------------------------------------------------------------------

    def drive(
        self,
        vehicle: str,
        command: Command | None = None,
        *,
        throttle: float = 0.0,
        steering: float = 0.0,
        headlights: int | None = None,
        indicators: int | None = None,
    ) -> None:
        """Send a command to a vehicle: a `Command`, or its values. Valid for half a simulated second: send it again.

        `throttle`, `steering` [-1, 1], left positive; `headlights` 0 off, 1 low, 2 high beam; `indicators` 0 off,
        1 left, 2 right, 3 hazard; None keeps their state. A refusal raises `CommandError` at the next call.
        """
        if command is None:
            command = Command(throttle, steering, headlights, indicators)  # type: ignore[arg-type]
        check_commands({vehicle: command})
        self.connection.send(Drive(vehicle, _plain(command)))

    def release(self, vehicle: str) -> None:
        """Stop being the driver of a vehicle, so that others can drive it at once."""
        self.connection.send(Release(vehicle))

    # -- requests: each returns the Frame after the operation ---------------------------------------------------

    def step(
        self, commands: Mapping[str, Command] | None = None, *, ticks: int = 1, timeout: float | None = None
    ) -> Frame:
        """Run `ticks` ticks, the first with these commands. A running simulation is paused first.

        The same scenario, seed and commands give the same bits as `World.step`.
        """
        commands = {} if commands is None else commands
        check_commands(commands)
        orders = {vehicle: _plain(command) for vehicle, command in commands.items()}
        if not self.connection.is_stepping:
            self.connection.begin_stepping()
        try:
            return self.connection.request(Step(ticks, orders), timeout)
        except CommandError:
            self.connection.is_stepping = False  # another client may have resumed it: the next step pauses again
            raise

    @contextmanager
    def lockstep(self) -> Iterator[Client]:
        """`with sim.lockstep(): ...` pauses the simulation for steps and resumes it at the end if it ran before."""
        was_paused = self.connection.is_stepping or self.status.is_paused  # a Status may be older than our Pause
        self.connection.begin_stepping()
        try:
            yield self
        finally:
            if not was_paused and not self.connection.is_closed:
                with suppress(ConnectionError):
                    self.resume()

    def ask(self, request: Operation) -> Frame:
        """Request any operation, for example `Teleport("V1", 1.0, 0.5)`."""
        return self.connection.request(request)

    def reset(self, seed: int | None = None) -> Frame:
        """Restore the initial state; `seed` None keeps the seed."""
        return self.connection.request(Reset(seed))

    def pause(self) -> Frame:
        """Stop simulated time."""
        frame = self.connection.request(Pause())
        self.connection.is_stepping = True
        return frame

    def resume(self) -> Frame:
        """Continue simulated time."""
        self.connection.is_stepping = False
        return self.connection.request(Resume())

    def set_speed(self, factor: float | None = 1.0) -> Frame:
        """Set the simulated seconds per wall second; None: as fast as possible."""
        return self.connection.request(SetSpeed(None if factor is None else _number("factor", factor)))

    def teleport(self, vehicle: str, x: float, y: float, yaw: float = 0.0) -> Frame:
        """Place a vehicle or an object, at rest, at x, y [m] in the map frame with heading yaw [rad], until a reset."""
        return self.connection.request(Teleport(vehicle, _number("x", x), _number("y", y), _number("yaw", yaw)))

    def set_scene_light(self, enabled: bool) -> Frame:
        """Switch to day (True) or night (False)."""
        return self.connection.request(SetSceneLight(bool(enabled)))

    def set_time_of_day(self, time: float | None, scale: float = 0.0) -> Frame:
        """Let sun and sky follow a time of day [s since midnight], None: the present one; see `SetTimeOfDay`."""
        seconds = None if time is None else _number("time", time)
        return self.connection.request(SetTimeOfDay(seconds, _number("scale", scale)))

    def set_weather(self, weather: Weather | None = None, *, keeps_ground: bool = False) -> Frame:
        """Set the weather, for example `Weather(rain=0.6)`; None: clear. The ground follows; see `SetWeather`."""
        weather = Weather() if weather is None else weather
        check_weather(weather)
        return self.connection.request(SetWeather(weather, bool(keeps_ground)))

    def set_traffic_light(self, light: str, state: TrafficLightState | int | None) -> Frame:
        """Let a traffic light show that state until a reset; None: what its program says."""
        return self.connection.request(SetTrafficLight(light, None if state is None else TrafficLightState(state)))

    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> Frame:
        """Let a vehicle obey a script (autonomous, True) or a person (manual, False)."""
        return self.connection.request(SetDrivingMode(vehicle, bool(is_autonomous)))

    def load_scenario(self, name: str, timeout: float = LOADING) -> Frame:
        """Load the scenario of that name, one of `scenarios`."""
        return self.connection.request(LoadScenario(name), timeout)

    # -- edits of the scenario; each returns the Frame after it ---------------------------------------------------

    def place(self, name: str, x: float, y: float, yaw: float = 0.0) -> Frame:
        """Place a vehicle or an object, at rest, at x, y [m] with heading yaw [rad], now and at the start."""
        return self.connection.request(Place(name, _number("x", x), _number("y", y), _number("yaw", yaw)))

    def add_box(
        self,
        name: str,
        x: float,
        y: float,
        yaw: float = 0.0,
        *,
        size: tuple[float, float, float] = (0.1, 0.1, 0.1),
        mass: float = 0.1,
    ) -> Frame:
        """Add a movable box on the ground at x, y [m] with heading yaw [rad]; `size` [m], `mass` [kg]."""
        length, width, height = map(float, size)
        box = AddBox(
            name, _number("x", x), _number("y", y), _number("yaw", yaw), (length, width, height), _number("mass", mass)
        )
        return self.connection.request(box)

    def remove_box(self, name: str) -> Frame:
        """Remove a movable box."""
        return self.connection.request(RemoveBox(name))

    def remove_traffic(self) -> Frame:
        """Remove the traffic of the scenario, for example before a map on which it cannot drive."""
        return self.connection.request(RemoveTraffic())

    def set_sensor(
        self,
        vehicle: str,
        sensor: str,
        *,
        is_on: bool = True,
        rate: float | None = None,
        noise: Literal["ideal", "file", "realistic", "strong"] | None = None,
    ) -> Frame:
        """Set a sensor or camera of a vehicle; an omitted value is as in the vehicle's file. See `SetSensor`."""
        settings = SetSensor(vehicle, sensor, bool(is_on), None if rate is None else _number("rate", rate), noise)
        return self.connection.request(settings)

    def edit_map(
        self, parts: Mapping[str, MapPart | None], *, seen: Mapping[str, MapPart | None] | None = None
    ) -> Frame:
        """Add, replace or remove (None) parts of the map, by name, as one edit; `scene.map_scene.parts` are those now.

        `seen`: parts as they were when you read them; None: not there. Raises `AutodriveError` if another client has
        changed one of them since, and if the map would not be possible.
        """
        return self.connection.request(EditMap(dict(parts), dict(seen or {})))

    def use_map(self, name: str = "", *, text: str = "") -> Frame:
        """Replace the map by one of the simulator, see `scene.map_scene.templates`, or by that of a file's text."""
        return self.connection.request(UseMap(name, text))

    def close_loop(self, part: str = "", port: str = "", other: str = "", other_port: str = "") -> Frame:
        """Add roads from an open end of a module to the nearest other one, or one of `other`; without `part`, at all.

        See `CloseLoop`.
        """
        return self.connection.request(CloseLoop(part, port, other, other_port))

    def insert_module(self, module: str, part: str, port: str, entry: str = "") -> Frame:
        """Insert a module where a port of the module `part` is joined with another one. See `InsertModule`."""
        return self.connection.request(InsertModule(module, part, port, entry))

    def edit_track(self, track: TrackLine, *, seen: TrackLine | None = None) -> Frame:
        """Make the map a track by points, or change it, as one edit; `scene.track_scene.line` is the one now.

        `seen`: the track as it was when you read it. Raises `AutodriveError` if another client has changed it since,
        and if the track would not be possible.
        """
        return self.connection.request(EditTrack(track, seen))

    def generate_track(
        self, seed: int = 0, *, length: float = 60.0, width: float = 1.2, barrier: Literal["wall", "duct"] = "wall"
    ) -> Frame:
        """Make the map a random track by points, the same for the same seed; length and width [m]."""
        size = _number("length", length), _number("width", width)
        return self.connection.request(GenerateTrack(int(seed), *size, barrier))

    def import_track(
        self,
        picture: bytes,
        text: str,
        *,
        start: tuple[float, float] | None = None,
        gap: float = 0.0,
        is_reversed: bool = False,
    ) -> Frame:
        """Make the track in a picture (PNG, PGM) with its YAML file of map_server the map. See `ImportTrack`."""
        return self.connection.request(ImportTrack(picture, text, "track", start, _number("gap", gap), is_reversed))

    def map_text(self, title: str = "") -> str:
        """The map with all edits, as YAML, with that title if there is one."""
        self.connection.request(SaveMap(title))
        return self.connection.text

    def undo(self) -> Frame:
        """Revert the latest edit; `status.undo` names it."""
        return self.connection.request(Undo())

    def redo(self) -> Frame:
        """Make the edit again that was reverted last; `status.redo` names it."""
        return self.connection.request(Redo())

    def scenario_text(self) -> str:
        """The scenario with all edits, as YAML: `Path("mine.yaml").write_text(sim.scenario_text())`."""
        self.connection.request(SaveScenario())
        return self.connection.text

    def urdf(self, vehicle: str) -> str:
        """The URDF of a vehicle as it is now: frames of sensors and wheels, masses, meshes. See `DescribeVehicle`."""
        self.connection.request(DescribeVehicle(vehicle), is_read=False)
        return self.connection.text

    # -- the devkit bridge ----------------------------------------------------------------------------------------

    def connect_bridge(self, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> Frame:
        """Connect the simulator to the devkit script at that address; see `status.bridge`."""
        return self.connection.request(ConnectBridge(host, port))

    def disconnect_bridge(self) -> Frame:
        """Close that connection, or stop trying to connect."""
        return self.connection.request(DisconnectBridge())

    def _check_camera(self, vehicle: str, camera: str) -> None:
        scene = self.connection.view.scene
        if scene is None:
            return
        known = [
            f"'{name}', '{camera_name}'" for name, vehicle in scene.vehicles.items() for camera_name in vehicle.cameras
        ]
        if vehicle not in scene.vehicles or camera not in scene.vehicles[vehicle].cameras:
            raise AutodriveError(f"there is no camera '{vehicle}', '{camera}'; there are {'; '.join(known) or 'none'}")


def _plain(command: Command) -> Command:
    """The Command with Python numbers, which may be given as numpy numbers."""
    return Command(
        float(command.throttle),
        float(command.steering),
        None if command.headlights is None else Headlights(command.headlights),
        None if command.indicators is None else Indicators(command.indicators),
    )


def _decoded(jpeg: bytes) -> NDArray[np.uint8]:
    try:
        import simplejpeg  # noqa: PLC0415  needed only for decoded pictures
    except ImportError:
        raise AutodriveError("decoding pictures requires simplejpeg: pip install simplejpeg") from None
    return read_only(simplejpeg.decode_jpeg(jpeg))


def _number(name: str, value: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise CommandError(f"{name} must be a number, not {reprlib.repr(value)}") from None
