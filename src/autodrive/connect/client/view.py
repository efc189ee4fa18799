"""Everything received from the simulator: Frames with their scans and events, pictures, status."""

from __future__ import annotations

from msgspec.structs import replace

from autodrive.base.suggest import ByName
from autodrive.protocol.messages import Event, Frame, Images, LidarScan
from autodrive.protocol.native import Error, Picture, Scan, Scene, ServerMessage, Status, Welcome


class ClientView:
    """Processes the messages of the server in order. `frame` is the latest Frame, with its scans and unread events."""

    def __init__(self) -> None:
        self.welcome: Welcome | None = None
        self.scene: Scene | None = None
        self.status: Status | None = None
        self.pictures: dict[tuple[str, str], Picture] = {}
        self.errors: list[Error] = []
        """Errors that belong to no request."""
        self.scans: dict[str, LidarScan] = {}
        """The latest scan of each vehicle, which may belong to the next Frame."""
        self.count = 0
        """Number of Frames received."""
        self.update_count = 0
        """Number of Frames, scans and pictures received."""
        self.is_new = False
        """Whether the latest Frame was not read yet."""
        self._latest: Frame | None = None
        self._its_scans: dict[str, LidarScan] = {}
        self._events: list[Event] = []
        self._whole: Frame | None = None

    def take(self, message: ServerMessage) -> None:
        """Process a message."""
        self.update_count += isinstance(message, Frame | Scan | Picture)
        match message:
            case Frame():
                self._take_frame(message)
            case Scan():
                self._take_scan(message)
            case Picture(vehicle=vehicle, camera=camera):
                self.pictures[vehicle, camera] = message
            case Status():
                self.status = message
            case Error(id=None):
                self.errors.append(message)
            case Welcome():
                self.welcome = message
            case Scene():
                self._begin(message)
            case _:
                pass

    @property
    def frame(self) -> Frame | None:
        """The latest Frame with the latest scan of each vehicle, and the events of all Frames that were not read."""
        if self._whole is None and self._latest is not None:
            scans = self._its_scans
            vehicles = ByName(
                {
                    name: replace(vehicle, lidar=scans.get(name), cameras=Images())
                    for name, vehicle in self._latest.vehicles.items()
                }
            )
            self._whole = replace(self._latest, vehicles=vehicles, events=tuple(self._events))
        return self._whole

    def read(self) -> Frame:
        """Read the latest Frame."""
        frame = self.frame
        assert frame is not None
        self.is_new = False
        return frame

    def _take_frame(self, frame: Frame) -> None:
        if not self.is_new:
            self._events = []
        if self._latest is not None and frame.tick < self._latest.tick:
            self._forget_after(frame.time)
        self._events += frame.events
        self._latest, self._its_scans, self._whole = frame, self.scans, None
        self.count += 1
        self.is_new = True

    def _take_scan(self, message: Scan) -> None:
        """The scan belongs to the next Frames, or to the latest if that was sent before the subscription of scans."""
        self.scans = {**self.scans, message.vehicle: message.scan}
        if self._latest is not None and message.scan.time <= self._latest.time:
            self._its_scans, self._whole = self.scans, None

    def _forget_after(self, time: float) -> None:
        """Discard scans and pictures from before a reset, whose time is later than now."""
        self.scans = {vehicle: scan for vehicle, scan in self.scans.items() if scan.time <= time}
        self.pictures = {key: picture for key, picture in self.pictures.items() if picture.time <= time}

    def _begin(self, scene: Scene) -> None:
        """Another world: discard everything of the previous one."""
        self.scene = scene
        self.pictures = {}
        self.scans = {}
        self._latest = self._whole = None
        self._events = []
        self.is_new = False
