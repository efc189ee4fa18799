"""Client: read a running simulator's Frames, drive its vehicles, step it, from any Python script."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from autodrive.client.conversation import Conversation
from autodrive.client.view import View
from autodrive.client.wire import Address
from autodrive.errors import AutodriveError, CommandError
from autodrive.protocol.messages import (
    Command,
    Frame,
    Headlights,
    Indicators,
    LoadScenario,
    Pause,
    Request,
    Reset,
    Resume,
    SetDrivingMode,
    SetSceneLight,
    SetSpeed,
    Step,
    Teleport,
)
from autodrive.protocol.native import (
    ConnectBridge,
    DisconnectBridge,
    Drive,
    Picture,
    Release,
    Scene,
    Status,
    Subscribe,
)
from autodrive.protocol.ports import DEVKIT_PORT, PORT

LOADING = 300.0
"""A scenario is loaded within that time: its maps may be drawn for the first time [s]."""


class Client:
    """A connection to a running simulator: `with autodrive.Client() as sim: ...`; for one thread.

    - `address`: 'host:port', or the link that the simulator prints. `token`: where one is needed and not in the link.
    - `name`: what others see as the driver; None: the script's file name.
    - `frame_rate`: Frames a second of wall time at most [Hz], None: each tick, 0: none. `scans`: whether they come.
    - `picture_rate`: pictures of each camera a second of wall time at most [Hz], 0: none. `picture_width` [pixels],
      None: the camera's own. `picture_quality` of the JPEG, 1 to 100.
    - `timeout`: the longest that an answer or a Frame is waited for [s]; then `TimeoutError`.
    - `patience`: how long a simulator that was lost is waited for [s], as when it is started anew; then
      `NoSimulatorError`, which is a `ConnectionError`.

    What the simulator refuses is a `CommandError` with its words: of a request at once, of a `drive`, which nobody
    answers, at the next call.
    """

    def __init__(
        self,
        address: str = f"127.0.0.1:{PORT}",
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
        self._talk = Conversation(Address.of(address, token), name, wanted, timeout, patience)
        self._heard = 0
        self._images: dict[tuple[str, str], tuple[Picture, NDArray[np.uint8]]] = {}

    def close(self) -> None:
        """Say goodbye; the simulation goes on, or stays paused, as it is."""
        self._talk.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # -- reading ------------------------------------------------------------------------------------------------

    @property
    def frame(self) -> Frame:
        """The latest Frame; its events are all since the Frame that was read before."""
        self._talk.catch_up()
        if self._talk.view.frame is None:
            return self.wait()
        return self._talk.view.taken()

    def wait(self, timeout: float | None = None) -> Frame:
        """The next Frame that was not read yet, which is the latest."""
        self._talk.catch_up()
        self._talk.until(lambda: self._talk.view.is_new, timeout, "Frame")
        return self._talk.view.taken()

    def frames(self, rate: float | None = None) -> Iterator[Frame]:
        """Each new Frame, for ever; `rate` a second of wall time at most [Hz], None: as the Client was made for.

        Whoever takes longer over one than the next takes to come gets the latest, with the events of those between.
        """
        usual = self._talk.subscription
        if rate is not None:
            self._talk.subscribe(msgspec.structs.replace(usual, frame_rate=rate))
        try:
            while True:
                yield self.wait()
        finally:
            if rate is not None and not self._talk.is_closed:
                self._talk.subscribe(usual)

    @property
    def pictures(self) -> dict[tuple[str, str], Picture]:
        """The latest picture of each camera by (vehicle, camera), as JPEG; needs a `picture_rate`."""
        self._talk.catch_up()
        return dict(self._talk.view.pictures)

    def image(self, vehicle: str, camera: str) -> NDArray[np.uint8]:
        """The latest picture of that camera, uint8, shape (height, width, 3), sRGB; waits for the first."""
        if not self._talk.subscription.picture_rate:
            raise AutodriveError("no pictures were asked for: make the Client with a picture_rate, for example 10")
        self._talk.catch_up()
        key = vehicle, camera
        self._check_camera(vehicle, camera)
        self._talk.until(
            lambda: key in self._talk.view.pictures, None, f"picture of camera '{camera}' of vehicle '{vehicle}'"
        )
        picture = self._talk.view.pictures[key]
        known = self._images.get(key)
        if known is None or known[0] is not picture:
            known = self._images[key] = picture, _decoded(picture.jpeg)
        return known[1]

    @property
    def status(self) -> Status:
        """Pause, speed, real-time factor, who drives, the bridge: as the simulator told last."""
        self._talk.catch_up()
        self._talk.until(lambda: self._talk.view.status is not None, None, "Status")
        assert self._talk.view.status is not None
        return self._talk.view.status

    @property
    def scene(self) -> Scene:
        """The scenario that runs: its name, map, tick [s] and vehicles."""
        self._talk.catch_up()
        self._talk.until(lambda: self._talk.view.scene is not None, None, "Scene")
        assert self._talk.view.scene is not None
        return self._talk.view.scene

    @property
    def scenarios(self) -> dict[str, str]:
        """Name -> title of those that `load_scenario` knows."""
        return dict(self._talk.view.welcome.scenarios) if self._talk.view.welcome else {}

    @property
    def name(self) -> str:
        """What others see: the name asked for, with a number if somebody has it already."""
        return self._talk.view.welcome.name if self._talk.view.welcome else self._talk.name

    def set_rates(self, frame_rate: float | None, picture_rate: float) -> None:
        """Want so many Frames and pictures from now on, as when the Client was made."""
        wanted = msgspec.structs.replace(self._talk.subscription, frame_rate=frame_rate, picture_rate=picture_rate)
        if wanted != self._talk.subscription:
            self._talk.subscribe(wanted)

    def wait_news(self, timeout: float | None = None) -> View:
        """What has been told, once a Frame, a scan or a picture has come that was not there at the last such call."""
        view = self._talk.view
        self._talk.until(lambda: self._talk.view is not view or self._talk.view.news > self._heard, timeout, "news")
        self._heard = self._talk.view.news
        return self._talk.view

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
        """Give a vehicle a command: a `Command`, or its values. Good for half a simulated second: send it again.

        `throttle`, `steering` [-1, 1], left positive; `headlights` 0 off, 1 low, 2 high beam; `indicators` 0 off,
        1 left, 2 right, 3 hazard; None leaves them as they are. What the simulator refuses is raised by the next call.
        """
        order = command or Command(throttle, steering, headlights, indicators)  # type: ignore[arg-type]
        self._talk.tell(Drive(vehicle, _plain(order)))

    def release(self, vehicle: str) -> None:
        """Let go of a vehicle's wheel, so that others may drive it at once."""
        self._talk.tell(Release(vehicle))

    # -- requests: each returns the Frame after it --------------------------------------------------------------

    def step(
        self, commands: Mapping[str, Command] | None = None, *, ticks: int = 1, timeout: float | None = None
    ) -> Frame:
        """Run `ticks` ticks, the first with these commands, and no more: the simulation is paused if it runs.

        The same scenario, seed and commands give the same bits as `World.step`.
        """
        orders = {vehicle: _plain(command) for vehicle, command in (commands or {}).items()}
        if not self._talk.is_stepping:
            self._talk.begin_stepping()
        try:
            return self._talk.ask(Step(ticks, orders), timeout)
        except CommandError:
            self._talk.is_stepping = False  # somebody may have resumed it: then the next step pauses it again
            raise

    @contextmanager
    def lockstep(self) -> Iterator[Client]:
        """`with sim.lockstep(): ...` pauses the simulation for steps, and resumes it in the end if it ran before."""
        was_paused = self._talk.is_stepping or self.status.is_paused  # a Status may be older than our Pause
        self._talk.begin_stepping()
        try:
            yield self
        finally:
            if not was_paused and not self._talk.is_closed:
                with suppress(ConnectionError):
                    self.resume()

    def ask(self, request: Request) -> Frame:
        """Any request as a message, for example `Teleport("V1", 1.0, 0.5)`."""
        return self._talk.ask(request)

    def reset(self, seed: int | None = None) -> Frame:
        """The initial state; `seed` None keeps the seed."""
        return self._talk.ask(Reset(seed))

    def pause(self) -> Frame:
        """Stop simulated time."""
        frame = self._talk.ask(Pause())
        self._talk.is_stepping = True
        return frame

    def resume(self) -> Frame:
        """Let simulated time run again."""
        self._talk.is_stepping = False
        return self._talk.ask(Resume())

    def set_speed(self, factor: float | None = 1.0) -> Frame:
        """Simulated seconds per wall second; None: as fast as possible."""
        return self._talk.ask(SetSpeed(None if factor is None else float(factor)))

    def teleport(self, vehicle: str, x: float, y: float, yaw: float = 0.0) -> Frame:
        """Put a vehicle, at rest, at x, y [m] of the map with heading yaw [rad]."""
        return self._talk.ask(Teleport(vehicle, float(x), float(y), float(yaw)))

    def set_scene_light(self, enabled: bool) -> Frame:
        """Day (True) or night (False)."""
        return self._talk.ask(SetSceneLight(bool(enabled)))

    def set_driving_mode(self, vehicle: str, is_autonomous: bool) -> Frame:
        """Who drives: a script (autonomous, True) or a person (manual, False)."""
        return self._talk.ask(SetDrivingMode(vehicle, bool(is_autonomous)))

    def load_scenario(self, name: str, timeout: float = LOADING) -> Frame:
        """Go over to the scenario of that name, one of `scenarios`."""
        return self._talk.ask(LoadScenario(name), timeout)

    def connect_bridge(self, host: str = "127.0.0.1", port: int = DEVKIT_PORT) -> Frame:
        """Have the simulator look for the devkit script that listens there; `status.bridge` tells how it stands."""
        return self._talk.ask(ConnectBridge(host, port))

    def disconnect_bridge(self) -> Frame:
        """End that connection, or the search for one."""
        return self._talk.ask(DisconnectBridge())

    def _check_camera(self, vehicle: str, camera: str) -> None:
        scene = self._talk.view.scene
        if scene is None:
            return
        known = [f"'{name}', '{its}'" for name, one in scene.vehicles.items() for its in one.cameras]
        if vehicle not in scene.vehicles or camera not in scene.vehicles[vehicle].cameras:
            raise AutodriveError(f"there is no camera '{vehicle}', '{camera}'; there are {'; '.join(known) or 'none'}")


def _plain(command: Command) -> Command:
    """With Python's own numbers, also of numpy's."""
    try:
        return Command(
            float(command.throttle),
            float(command.steering),
            None if command.headlights is None else Headlights(command.headlights),
            None if command.indicators is None else Indicators(command.indicators),
        )
    except (TypeError, ValueError) as error:
        raise CommandError(f"{command} is no Command: {error}") from None


def _decoded(jpeg: bytes) -> NDArray[np.uint8]:
    try:
        import simplejpeg  # noqa: PLC0415 - only who wants pictures as arrays needs it
    except ImportError:
        raise AutodriveError("pictures are decoded with simplejpeg: pip install simplejpeg") from None
    image = simplejpeg.decode_jpeg(jpeg)
    image.setflags(write=False)
    return image
