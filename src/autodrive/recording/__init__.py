"""Recordings: what a World did, in one MCAP file that is read, replayed, compared, and simulated again.

`Recorder` writes, `open` reads; `autodrive run --record FILE.mcap` records a run. The file is a standard MCAP file
(https://mcap.dev), which Foxglove, Lichtblick and Rerun open.

Time. `log_time` of a message is the simulated time since the start of the recording [ns]; a reset does not set it
back, so it never decreases. `publish_time` is the simulated time of the Frame, which a reset sets back. `sequence` is
its tick.

Order. The messages of a tick are in this order: commands, requests, scenario (if the World is another), events, scans,
images, states of the vehicles, poses, and at last the Frame, which completes the tick. A chunk ends after a Frame; a
chunk has at most 0.5 MB, or 0.8 s of wall time, so that a killed process loses less than a second.

| topic | schema | encoding | content |
|---|---|---|---|
| `/autodrive/scenario` | `autodrive.Scenario` | JSON | a World begins: scenario, seed, all its files |
| `/autodrive/commands` | `autodrive.Commands` | JSON | commands given to `World.step`, each tick with any |
| `/autodrive/requests` | `autodrive.Request` | JSON | each request that was executed: reset, light, mode, edits ... |
| `/autodrive/events` | `autodrive.Event` | JSON | each event: collision, departure from the road ... |
| `/autodrive/status` | `autodrive.Status` | JSON | once a second: real-time factor, what was left out, devkit bridge |
| `/autodrive/frame` | `autodrive.Frame` | Protobuf | a Frame: time, tick, names of the vehicles, objects, light |
| `/V1/state` | `autodrive.VehicleFrame` | Protobuf | vehicle V1 in that Frame, with the times of scan and images |
| `/V1/lidar` | `foxglove.LaserScan` | Protobuf | each scan once; the fields from number 101 complete our `LidarScan` |
| `/V1/cameras/front` | `foxglove.CompressedImage` | Protobuf | each image once, as JPEG, with its pose and intrinsics |
| `/V1/cameras/front/calibration` | `foxglove.CameraCalibration` | Protobuf | before the first image |
| `/drawings` | `foxglove.SceneUpdate` | Protobuf | what programs draw into the view |
| `/tf` | `foxglove.FrameTransforms` | Protobuf | poses of vehicles, objects, LIDARs and cameras, at most 10 Hz |

The Protobuf messages of a Frame and of a vehicle derive from the structs in `protocol.messages`: field names are the
same, arrays are `repeated double`, whole numbers are `sfixed64`; a number that is missing is 0. The schema in the file
says which number a field has. JSON has each number with all its digits, so that commands are the same bits again.

Metadata `autodrive`: format (`records.FORMAT`), versions of AutoDRIVE, MuJoCo, numpy and Python, platform, scenario,
seed, tick, JPEG quality. Attachments: the .glb files of map, vehicles and boxes; a scenario message names them by part
('map', 'vehicle/V1', 'object/box_1'). The URDF of each vehicle ('urdf/V1') and its meshes (STL) have the paths of the
ROS package autodrive_description.

Not recorded: depth and label images, and images without JPEG.
"""

from pathlib import Path

from autodrive.recording.errors import RecordingError as RecordingError
from autodrive.recording.recorder import Recorder as Recorder
from autodrive.recording.recording import Moment as Moment
from autodrive.recording.recording import Recording as Recording
from autodrive.recording.recording import TimedEvent as TimedEvent


def open(path: str | Path) -> Recording:
    """Open a recording. Raises `RecordingError` if the file is not a recording, or of a newer version."""
    return Recording(Path(path))
