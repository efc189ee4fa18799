"""What the simulator has told so far, put together: Frames with their scans and all events, pictures, its status."""

from __future__ import annotations

from msgspec.structs import replace

from autodrive.protocol.messages import Event, Frame, LidarScan
from autodrive.protocol.native import Fault, Picture, Scan, Scene, ServerMessage, Status, Welcome


class View:
    """Takes the server's messages in order. `frame` is the latest, whole; it has the events of those nobody took."""

    def __init__(self) -> None:
        self.welcome: Welcome | None = None
        self.scene: Scene | None = None
        self.status: Status | None = None
        self.pictures: dict[tuple[str, str], Picture] = {}
        self.faults: list[Fault] = []
        """Those that belong to no request."""
        self.scans: dict[str, LidarScan] = {}
        """The latest of each vehicle, which may belong to a Frame that is still to come."""
        self.count = 0
        """Frames that came."""
        self.news = 0
        """Frames, scans and pictures that came."""
        self.is_new = False
        """Whether nobody took the latest Frame."""
        self._latest: Frame | None = None
        self._its_scans: dict[str, LidarScan] = {}
        self._events: list[Event] = []
        self._whole: Frame | None = None

    def take(self, message: ServerMessage) -> None:
        """Take note of a message."""
        self.news += isinstance(message, Frame | Scan | Picture)
        match message:
            case Frame():
                self._take_frame(message)
            case Scan():
                self._take_scan(message)
            case Picture(vehicle=vehicle, camera=camera):
                self.pictures[vehicle, camera] = message
            case Status():
                self.status = message
            case Fault(id=None):
                self.faults.append(message)
            case Welcome():
                self.welcome = message
            case Scene():
                self._begin(message)
            case _:
                pass

    @property
    def frame(self) -> Frame | None:
        """The latest Frame with the latest scan of each vehicle, and the events of all Frames that were not taken."""
        if self._whole is None and self._latest is not None:
            scans = self._its_scans
            vehicles = {
                name: replace(vehicle, lidar=scans[name]) if name in scans else vehicle
                for name, vehicle in self._latest.vehicles.items()
            }
            self._whole = replace(self._latest, vehicles=vehicles, events=tuple(self._events))
        return self._whole

    def taken(self) -> Frame:
        """The latest Frame, which is no longer new."""
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
        """It belongs to the Frames to come, or to the latest if that was sent before scans were wanted."""
        self.scans = {**self.scans, message.vehicle: message.scan}
        if self._latest is not None and message.scan.time <= self._latest.time:
            self._its_scans, self._whole = self.scans, None

    def _forget_after(self, time: float) -> None:
        """The world was reset: what was measured later than it is now, was before."""
        self.scans = {vehicle: scan for vehicle, scan in self.scans.items() if scan.time <= time}
        self.pictures = {key: picture for key, picture in self.pictures.items() if picture.time <= time}

    def _begin(self, scene: Scene) -> None:
        """Another world: what was of the one before is past."""
        self.scene = scene
        self.pictures = {}
        self.scans = {}
        self._latest = self._whole = None
        self._events = []
        self.is_new = False
