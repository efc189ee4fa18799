"""The operations that clients request: the coroutines of those of the server, and the kinds of all."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.connect.server.connected_client import Answer
from autodrive.connect.server.request_queue import RequestKind
from autodrive.protocol import messages, native, own_files, replay
from autodrive.world.editing.map_export import exported_map

if TYPE_CHECKING:
    from autodrive.connect.server.bridge_control import BridgeControl
    from autodrive.connect.server.served import Served

SHORT, BUILD, MAP_EDIT = RequestKind(), RequestKind("build"), RequestKind("map edit")
OF_SERVER = RequestKind(is_of_server=True)
VIEW = RequestKind(is_of_server=True, is_replaced=True, least_work=0.004)
KINDS: dict[type, RequestKind] = {
    messages.Pause: RequestKind(change="paused the simulation"),
    messages.Resume: RequestKind(change="resumed the simulation"),
    messages.Step: RequestKind(is_limited=False),
    messages.Reset: RequestKind(is_replaced=True, change="reset the simulation"),
    messages.Seek: RequestKind(is_replaced=True),
    messages.SetSpeed: RequestKind(is_replaced=True, change="changed the speed"),
    messages.SetSceneLight: RequestKind(is_replaced=True, change="changed the light"),
    messages.SetTimeOfDay: RequestKind(is_replaced=True, change="changed the time of day"),
    messages.SetWeather: RequestKind(is_replaced=True, change="changed the weather"),
    messages.LoadScenario: RequestKind("build", is_replaced=True, is_common=True, change="loaded a scenario"),
    **dict.fromkeys((messages.Place, messages.AddBox, messages.RemoveBox, messages.SetSensor), BUILD),
    messages.RemoveTraffic: RequestKind("build", change="removed the traffic"),
    **dict.fromkeys((messages.Undo, messages.Redo, own_files.ImportTrack), BUILD),
    **dict.fromkeys((messages.EditMap, messages.CloseLoop, messages.InsertModule), MAP_EDIT),
    **dict.fromkeys((messages.EditTrack, messages.GenerateTrack), MAP_EDIT),
    messages.UseMap: RequestKind("map edit", change="opened another map"),
    own_files.OpenFile: RequestKind("build", change="opened a file"),
    native.SetCamera: VIEW,
    native.ViewSensor: VIEW,
    native.DescribeWeather: RequestKind(is_of_server=True, is_beside=True),
    native.ConnectBridge: RequestKind(is_of_server=True, is_replaced=True, least_work=0.05),
    replay.StartRecording: RequestKind(is_of_server=True, least_work=0.05),
}
"""Kinds of operations; others of the server are `OF_SERVER`, others of the simulation are short requests."""

OFFERED: tuple[native.ServerOperation, ...] = (
    *(messages.Reset(), messages.Pause(), messages.Step(), messages.SetSpeed(1.0), messages.LoadScenario("")),
    *(messages.SetDrivingMode("", False), messages.SetWeather(), messages.SetTrafficLight("", None)),
    *(messages.Place("", 0.0, 0.0), messages.UseMap(), native.ConnectBridge(), replay.StartRecording()),
)
"""Operations for which a page has a button, as examples: those that are refused are in the Status."""


class ServerOperations:
    """What the server executes beside the simulation, in its event loop. All of it raises `AutodriveError`."""

    def __init__(self, served: Served, bridge: BridgeControl) -> None:
        self._served = served
        self._recording_lock, self._weather_lock = asyncio.Lock(), asyncio.Lock()
        recording = served.recording
        self.table: dict[type, Callable[[Any], Awaitable[Answer | None]]] = {
            native.ConnectBridge: lambda request: bridge.connect(request.host, request.port),
            native.DisconnectBridge: lambda _: bridge.disconnect(),
            native.LetDrive: partial(
                asyncio.to_thread, lambda request: served.let_drive(request.vehicle, request.is_on)
            ),
            native.DescribeWeather: self._describe_weather,
            native.DescribeVehicle: partial(asyncio.to_thread, self._vehicle_description),
            replay.StartRecording: lambda request: self._record(recording.start, request.keep),
            replay.StopRecording: lambda _: self._record(recording.stop),
            replay.SaveRecording: lambda _: self._record(recording.save),
            replay.FilmRecording: lambda request: self._record(recording.film, request),
            replay.ReplayRecording: lambda request: self._record(recording.replay, request.name),
            replay.PlotRecording: partial(asyncio.to_thread, self._curves),
            own_files.ListFiles: partial(asyncio.to_thread, lambda _: Answer(files=served.own_files.listed())),
            own_files.SaveFile: partial(asyncio.to_thread, self._saved_file),
            own_files.ExportMap: partial(asyncio.to_thread, self._exported_map),
        }
        """Type of operation -> the coroutine that executes it; None: there is no answer."""

    def kind(self, operation: native.ServerOperation) -> RequestKind:
        """How an operation is executed."""
        return KINDS.get(type(operation), OF_SERVER if type(operation) in self.table else SHORT)

    async def _record(self, control: Callable[..., str | None], *arguments: Any) -> Answer:
        async with self._recording_lock:
            return Answer(await asyncio.to_thread(control, *arguments) or "")

    async def _describe_weather(self, _: native.DescribeWeather) -> Answer:
        simulation = self._served.simulation
        async with self._weather_lock:
            return Answer(await asyncio.to_thread(_weather_text, simulation.frame, simulation.world.map.ground))

    # -- in other threads: the world that they see is the present one -------------------------------------------

    def _vehicle_description(self, request: native.DescribeVehicle) -> Answer:
        """The answer with the URDF of a vehicle."""
        from autodrive.world.views.scene_files import vehicle_urdf  # noqa: PLC0415  imports what draws meshes

        world, name = self._served.simulation.world, request.vehicle
        if name not in world.vehicle_specs:
            raise AutodriveError(f"vehicle '{name}' is not known. {suggest(name, list(world.vehicle_specs))}")
        return Answer(vehicle_urdf(world, name))

    def _curves(self, request: replay.PlotRecording) -> Answer:
        if self._served.replay is None:
            raise AutodriveError("a simulation has no recording to plot: use 'autodrive replay FILE'")
        curves, missing = self._served.replay.curves(request)
        return Answer(missing, curves)

    def _saved_file(self, request: own_files.SaveFile) -> Answer:
        simulation = self._served.simulation
        write = simulation.map_text if request.kind == "map" else simulation.scenario_text
        name = self._served.own_files.save(request.name, write(request.title), replaces=request.replaces)
        return Answer(name)

    def _exported_map(self, request: own_files.ExportMap) -> Answer:
        text, picture = exported_map(self._served.simulation.world.map, request.name, request.resolution)
        return Answer(text, picture=picture)


def _weather_text(frame: messages.Frame, ground: Any) -> str:
    """Text of the weather in numbers."""
    is_day = None if frame.time_of_day is None else frame.scene_light
    return _weather_numbers(frame.weather or messages.Weather(), ground, is_day)


@lru_cache(maxsize=1)
def _weather_numbers(weather: messages.Weather, ground: Any, is_day: bool | None) -> str:
    from autodrive.world.views.weather_numbers import weather_numbers  # noqa: PLC0415  it imports the batch

    return weather_numbers(weather, ground, is_day=is_day)
