"""Run summary as JSON-serialisable values."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, Literal

from autodrive.base.texts import with_encodable_texts
from autodrive.base.transforms import euler_from_quaternion
from autodrive.base.version import __version__
from autodrive.protocol.messages import Collision, Frame, Pose

if TYPE_CHECKING:
    from autodrive.connect.bridge.devkit import DevkitBridge
    from autodrive.recording import Recorder
    from autodrive.world.simulation import Simulation


@dataclass(frozen=True)
class PoseSummary:
    """Pose of a vehicle at the end of the run, in the world frame."""

    position: tuple[float, float, float]
    """Centre of the rear axle [m]."""
    orientation: tuple[float, float, float, float]
    """Quaternion wxyz."""
    yaw: float
    """Heading [rad]."""


@dataclass(frozen=True)
class VehicleSummary:
    """One vehicle of the run."""

    mode: Literal["manual", "autonomous"]
    distance: float
    """Path length of the rear axle centre [m]."""
    collisions: int
    pose: PoseSummary


@dataclass(frozen=True)
class ImageCount:
    """Images of one camera."""

    count: int
    rate: float
    """Images per simulated second [Hz]."""


@dataclass(frozen=True)
class CamerasSummary:
    """The cameras of the last world of the run."""

    error: str | None
    """Why there are no images; None if there are."""
    drawn_in: Literal["process", "tick"]
    renderer: str | None
    """Name of the OpenGL renderer; None if nothing was rendered."""
    draw_time: float | None
    """Median time to render all images that are due at once [s]; None if they are rendered in the tick."""
    images: dict[str, dict[str, ImageCount]]
    """Images by vehicle and camera."""


@dataclass(frozen=True)
class BridgeSummary:
    """Counters of the devkit bridge; see `autodrive.connect.bridge.metrics.Counters`."""

    address: str
    dialect: str | None
    profile: str | None
    connections: int
    reconnects: int
    telemetry_sent: int
    commands_received: int
    resends: int
    refused_values: int
    round_trip: float | None
    """Median time from a telemetry message to the next command [s]; None before the first command."""


@dataclass(frozen=True)
class RecordingSummary:
    """The recording of the run."""

    files: list[str]
    """Files that were written."""
    dropped_frames: int
    """Frames that were left out, because the disk or the processor was too slow."""
    dropped_images: int
    error: str
    """Why the recording ended before the run; empty if it did not."""


@dataclass(frozen=True)
class PageSummary:
    """The page server of the run."""

    link: str


@dataclass(frozen=True)
class Summary:
    """Result of a run: `as_dict` and `to_json` give the content of the summary file."""

    version: str
    scenario: str
    """Name or file of the last scenario that was loaded."""
    map: str
    seed: int
    speed: float | Literal["max"]
    """Requested simulated seconds per second of wall time."""
    ended_by: str
    """"duration", or the reason of the stop request, for example "SIGINT"."""
    simulated_time: float
    """[s]"""
    wall_time: float
    """Wall time without pauses [s]."""
    real_time_factor: float
    ticks: int
    late_ticks: int
    vehicles: dict[str, VehicleSummary]
    cameras: CamerasSummary | None
    """Images of the cameras; None if no camera images were enabled."""
    bridge: BridgeSummary | None
    """Messages of the devkit bridge; None if it was never used."""
    page: PageSummary | None
    """The page; None if no page was served."""
    recording: RecordingSummary | None = None
    """The recording; None if the run was not recorded."""

    def to_json(self) -> str:
        """The text of the summary file."""
        return json.dumps(with_encodable_texts(asdict(self)), indent=2) + "\n"

    def as_dict(self) -> dict[str, Any]:
        """The values of the summary file: dictionaries, lists, strings, numbers and None."""
        return json.loads(self.to_json())


class Odometer:
    """Sink: accumulates distance and collisions of each vehicle over resets, teleports and scenario changes."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._tick = 0
        self.distance: dict[str, float] = {}
        """Path length of the rear axle centre [m], by vehicle."""
        self.collisions: dict[str, int] = {}

    def publish(self, frame: Frame) -> None:
        """Add the distance of one tick; ignore a Frame that a request published without a tick."""
        if frame.tick != self._tick:
            tick_duration = self._simulation.world.tick_duration
            for name, vehicle in frame.vehicles.items():
                distance = math.hypot(*vehicle.velocity[:2]) * tick_duration
                self.distance[name] = self.distance.get(name, 0.0) + distance
            for event in frame.events:
                if isinstance(event, Collision):
                    self.collisions[event.vehicle] = self.collisions.get(event.vehicle, 0) + 1
        self._tick = frame.tick


def run_summary(
    simulation: Simulation,
    odometer: Odometer,
    *,
    scenario: str,
    ended_by: str,
    cameras: CamerasSummary | None,
    bridge: DevkitBridge,
    page_link: str,
    recorder: Recorder | None = None,
) -> Summary:
    """Summary of a run that has ended; `page_link` is empty if no page was served."""
    wall_time = simulation.running_time
    spec = simulation.world.spec
    return Summary(
        version=__version__,
        scenario=scenario,
        map=spec.map_name,
        seed=spec.seed,
        speed="max" if simulation.speed is None else simulation.speed,
        ended_by=ended_by,
        simulated_time=simulation.simulated_time,
        wall_time=wall_time,
        real_time_factor=simulation.simulated_time / wall_time if wall_time else 0.0,
        ticks=simulation.ticks,
        late_ticks=simulation.late_ticks,
        vehicles={
            name: VehicleSummary(
                mode="autonomous" if vehicle.is_autonomous else "manual",
                distance=odometer.distance.get(name, 0.0),
                collisions=odometer.collisions.get(name, 0),
                pose=_pose_summary(vehicle.pose),
            )
            for name, vehicle in simulation.frame.vehicles.items()
        },
        cameras=cameras,
        bridge=_bridge_summary(bridge),
        page=PageSummary(page_link) if page_link else None,
        recording=recorder and _recording_summary(recorder),
    )


def _recording_summary(recorder: Recorder) -> RecordingSummary:
    files = [str(path) for path in recorder.files]
    return RecordingSummary(files, recorder.dropped_frames, recorder.dropped_images, recorder.error)


def _bridge_summary(bridge: DevkitBridge) -> BridgeSummary | None:
    counters = bridge.counters
    if bridge.status == "closed" and not counters.connections:
        return None
    return BridgeSummary(
        address=bridge.address,
        dialect=counters.dialect.value if counters.dialect else None,
        profile=counters.profile,
        connections=counters.connections,
        reconnects=counters.reconnects,
        telemetry_sent=counters.telemetry_sent,
        commands_received=counters.commands_received,
        resends=counters.resends,
        refused_values=counters.refused_values,
        round_trip=None if math.isnan(counters.round_trip) else counters.round_trip,
    )


def _pose_summary(pose: Pose) -> PoseSummary:
    x, y, z = map(float, pose.position)
    qw, qx, qy, qz = map(float, pose.orientation)
    return PoseSummary((x, y, z), (qw, qx, qy, qz), float(euler_from_quaternion(pose.orientation)[2]))
