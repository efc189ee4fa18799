"""What a recording holds: its topics, its messages, and how a Frame is taken apart and put together again."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec
import numpy as np

from autodrive.base.arrays import read_only
from autodrive.base.texts import total
from autodrive.base.yaml_files import MAX_BYTES
from autodrive.protocol.messages import Command, Event, Frame, VehicleFrame
from autodrive.recording.errors import RecordingError
from autodrive.recording.wire import Schemas, WireMessage
from autodrive.scenario import MAX_VEHICLES
from autodrive.scenario.maps.spec import MAX_PLACEMENTS
from autodrive.world.observer import Request

FORMAT = 2
"""Version of the format: in 1, all numbers are written; in 2, messages are without those that are zero.

A reader refuses files of a newer version. New topics and new fields do not change it.
"""

MAX_JSON = 2**22
"""Largest message in JSON that is read [bytes]."""
MAX_FILES = MAX_PLACEMENTS + MAX_VEHICLES + 3
"""Files of a scenario: modules of its map, vehicles, map, rules and track."""

PROFILE = "autodrive"
"""Name of the metadata record by which a reader recognises a recording."""

SCENARIO = "/autodrive/scenario"
COMMANDS = "/autodrive/commands"
REQUESTS = "/autodrive/requests"
EVENTS = "/autodrive/events"
STATUS = "/autodrive/status"
FRAME = "/autodrive/frame"
TRANSFORMS = "/tf"
DRAWINGS = "/drawings"


STATE, STATE_TYPE = "state", "application/zlib"
"""Name and type of the attachment with the state of the World at the first Frame, see `world.saved_world`."""


def state_topic(vehicle: str) -> str:
    """Topic of the readings of a vehicle, without scans and images."""
    return f"/{vehicle}/state"


def scan_topic(vehicle: str) -> str:
    """Topic of the LIDAR scans of a vehicle."""
    return f"/{vehicle}/lidar"


def own_topic(vehicle: str, sensor: str) -> str:
    """Topic of the readings of a sensor of the user."""
    return f"/{vehicle}/own/{sensor}"


def image_topic(vehicle: str, camera: str) -> str:
    """Topic of the images of a camera."""
    return f"/{vehicle}/cameras/{camera}"


def calibration_topic(vehicle: str, camera: str) -> str:
    """Topic of the pinhole model of a camera."""
    return f"{image_topic(vehicle, camera)}/calibration"


# -- messages in JSON ----------------------------------------------------------------------------------------------


class ScenarioRecord(msgspec.Struct, frozen=True):
    """A World begins: that of the start, of another scenario, or of an edit that makes a new World."""

    tick: int
    name: str
    """Name or file of the scenario."""
    spec: dict[str, Any]
    """The `ScenarioSpec`."""
    files: dict[str, str]
    """Texts of all files that it names, by kind and name, such as 'map/mini_map'."""
    is_start: bool
    """Whether the World is in its initial state, so that it can be simulated again from here."""
    attachments: dict[str, str] = {}
    """Names of the attachments with the meshes: 'map', 'vehicle/V1', 'object/box_1'; 'urdf/V1' of the URDF."""
    own_sensors: dict[str, list[str]] = {}
    """Names of the sensors of the user by vehicle; their code is not in the recording."""


class CommandsRecord(msgspec.Struct, frozen=True):
    """The commands that were given to the World in the tick after `tick`, by vehicle."""

    tick: int
    commands: dict[str, Command]


class RequestRecord(msgspec.Struct, frozen=True):
    """A request that was executed after `tick`, before the next one."""

    tick: int
    request: Request


class EventRecord(msgspec.Struct, frozen=True):
    """An event of the tick `tick`."""

    tick: int
    event: Event


class StatusRecord(msgspec.Struct, frozen=True):
    """State of the run, about once a second."""

    tick: int
    real_time_factor: float
    late_ticks: int
    dropped_frames: int
    """Frames that the recorder has left out since the start, because the disk or the processor was too slow."""
    dropped_images: int
    bridge: str = "closed"
    """State of the connection to a devkit script."""


RECORDS: dict[str, type[msgspec.Struct]] = {
    SCENARIO: ScenarioRecord,
    COMMANDS: CommandsRecord,
    REQUESTS: RequestRecord,
    EVENTS: EventRecord,
    STATUS: StatusRecord,
}
"""Messages in JSON, by topic."""


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} cannot be recorded")


def _typed(kind: type, value: Any) -> Any:
    """An array from a list."""
    return read_only(np.array(value, np.float64))


encode_json = total(msgspec.json.Encoder(enc_hook=_plain).encode)
_DECODERS = {topic: msgspec.json.Decoder(kind, dec_hook=_typed).decode for topic, kind in RECORDS.items()}


def decode_json(topic: str, data: bytes) -> Any:
    """The record of a message. Raises `RecordingError`."""
    if len(data) > MAX_JSON:
        raise RecordingError(f"a message of the topic '{topic}' has {len(data)} bytes; at most {MAX_JSON} are read")
    try:
        record = _DECODERS[topic](data)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise RecordingError(f"a message of the topic '{topic}' is damaged: {error}") from None
    if isinstance(record, ScenarioRecord):
        if len(record.files) > MAX_FILES:
            raise RecordingError(f"a scenario has {len(record.files)} files; at most {MAX_FILES} are read")
        for name, text in record.files.items():
            if len(text) > MAX_BYTES:
                raise RecordingError(f"the file '{name[:100]}' of a scenario is larger than {MAX_BYTES} bytes")
    return record


def json_schema(topic: str) -> bytes:
    """JSON Schema of the messages of a topic."""
    array = {"type": "array", "items": {"type": "number"}}
    _, parts = msgspec.json.schema_components(
        [RECORDS[topic]], schema_hook=lambda _: array, ref_template="#/$defs/{name}"
    )
    name = RECORDS[topic].__name__
    return msgspec.json.encode(parts.pop(name) | {"$defs": parts})


# -- Frames --------------------------------------------------------------------------------------------------------


class States:
    """The messages of a Frame: one of the Frame itself and one for each vehicle; see `autodrive.recording`.

    Both follow from the structs: a new field of `Frame` or `VehicleFrame` is recorded without a change here. `schemas`:
    those of the file that is read.
    """

    def __init__(self, schemas: Schemas | None = None) -> None:
        self.frame = WireMessage(
            Frame, replaced={"vehicles": tuple[str, ...], "events": tuple[str, ...]}, schemas=schemas
        )
        self.vehicle = WireMessage(
            VehicleFrame,
            replaced={"lidar": float | None, "cameras": dict[str, float], "own": dict[str, float]},
            schemas=schemas,
        )

    def encode_frame(self, frame: Frame) -> bytes:
        """The Frame without its events, and with the names of its vehicles."""
        return self.frame.encode(frame, {"vehicles": tuple(frame.vehicles), "events": ()})

    def encode_vehicle(self, vehicle: VehicleFrame, scan_time: float | None, image_times: Mapping[str, float]) -> bytes:
        """The vehicle; scan, images and readings of the user's sensors are replaced by their times [s]."""
        own = {name: reading.time for name, reading in vehicle.own.items()}
        return self.vehicle.encode(vehicle, {"lidar": scan_time, "cameras": image_times, "own": own})

    def decode_frame(self, data: bytes) -> dict[str, Any]:
        """Fields of the Frame. Raises `RecordingError`."""
        return _required(self.frame, self.frame.decode(data))

    def decode_vehicle(self, data: bytes) -> dict[str, Any]:
        """Fields of the vehicle. Raises `RecordingError`."""
        return _required(self.vehicle, self.vehicle.decode(data))


def _required(message: WireMessage, values: dict[str, Any]) -> dict[str, Any]:
    if any(value is msgspec.NODEFAULT for value in values.values()):
        missing = [name for name, value in values.items() if value is msgspec.NODEFAULT]
        raise RecordingError(f"a message '{message.name}' has no {', '.join(missing)}")
    return values


def schema_name(topic: str) -> str:
    """Name of the schema of the messages of a topic in JSON."""
    return f"autodrive.{RECORDS[topic].__name__.removesuffix('Record')}"
