"""What viewers ask for, carried out: commands of who holds the wheel, requests, the bridge to a devkit script."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING

from autodrive.bridge.gauge import Gauge
from autodrive.bridge.mail import Mail
from autodrive.bridge.seats import Seats
from autodrive.descriptions import suggest
from autodrive.errors import AutodriveError
from autodrive.protocol.messages import Frame, LoadScenario, Pause, Request, Resume, Step
from autodrive.protocol.native import (
    BridgeStatus,
    ConnectBridge,
    DisconnectBridge,
    Drive,
    Fault,
    Please,
    SetCamera,
    Source,
)

if TYPE_CHECKING:
    from autodrive.bridge.devkit import DevkitBridge
    from autodrive.bridge.filming import Filming
    from autodrive.bridge.viewer import Viewer
    from autodrive.simulation import Simulation

PENDING = 64
"""So many requests of a client may be under way."""
TICKS = 10_000
"""A Step over the wire is no longer."""
NOT_PAUSED = "a Step needs a paused simulation; request Pause first"


class Errands:
    """Lives in the server's loop. `show_status` has a Status sent to all."""

    def __init__(
        self,
        simulation: Simulation,
        mail: Mail,
        seats: Seats,
        bridge: DevkitBridge | None,
        scenarios: dict[str, str],
        filming: Filming,
        show_status: Callable[[], None],
    ) -> None:
        self.note = ""
        """What takes a while."""
        self._simulation = simulation
        self._mail = mail
        self._seats = seats
        self._bridge = bridge
        self._gauge = Gauge(bridge) if bridge is not None else None
        self._scenarios = scenarios
        self._filming = filming
        self._show_status = show_status
        self._will_pause: list[bool] = []
        self._complained: dict[tuple[Viewer, str], float] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def bridge_status(self, now: float) -> BridgeStatus:
        """How the bridge stands."""
        return self._gauge.read(now) if self._gauge is not None else BridgeStatus()

    # -- driving ------------------------------------------------------------------------------------------------

    def drive(self, viewer: Viewer, drive: Drive, now: float) -> None:
        """Pass a command on, if this client may drive that vehicle."""
        vehicle = self._simulation.frame.vehicles.get(drive.vehicle)
        if vehicle is None:
            known = suggest(drive.vehicle, list(self._simulation.frame.vehicles))
            self._complain(viewer, Fault("request", f"vehicle '{drive.vehicle[:40]}' is not known. {known}"), now)
            return
        obeyed: Source = "script" if vehicle.is_autonomous else "person"
        if drive.source != obeyed:
            self._complain(viewer, Fault("mode", _wrong_mode(drive)), now)
            return
        before = self._seats.drivers(now).get(drive.vehicle)
        other = self._seats.take(drive.vehicle, viewer, drive.source, obeyed, now)
        if other is not None:
            self._complain(viewer, Fault("taken", _taken(drive.vehicle, other)), now)
            return
        try:
            self._simulation.submit(drive.vehicle, drive.command, drive.source)
        except AutodriveError as error:
            self._complain(viewer, Fault("request", str(error)), now)
        if before is not viewer:
            self._show_status()

    def forget(self, viewer: Viewer) -> None:
        """It went away."""
        self._filming.forget(viewer)
        self._seats.leave(viewer)
        self._complained = {key: at for key, at in self._complained.items() if key[0] is not viewer}

    def _complain(self, viewer: Viewer, fault: Fault, now: float) -> None:
        """Of a kind, once a second: commands come often."""
        if now >= self._complained.get((viewer, fault.code), -math.inf) + 1.0:
            self._complained[viewer, fault.code] = now
            viewer.fault(fault)

    # -- requests -----------------------------------------------------------------------------------------------

    def request(self, viewer: Viewer, please: Please, now: float) -> None:
        """Carry it out; its Done or Fault follows."""
        if viewer.pending >= PENDING:
            viewer.fault(Fault("rate", f"more than {PENDING} requests are under way: wait for their Done", please.id))
            return
        try:
            match please.request:
                case ConnectBridge(host=host, port=port):
                    self._connect(host, port)
                    self._show_status()
                    viewer.done(please.id, self._simulation.frame)
                case DisconnectBridge():
                    self._begin(self._disconnect(viewer, please.id))
                case SetCamera() as wish:
                    self._filming.wish(viewer, wish, now)
                    viewer.done(please.id, self._simulation.frame)
                case request:
                    self._pass_on(viewer, please.id, request, now)
        except AutodriveError as error:
            viewer.fault(Fault("request", str(error), please.id))
        except _TakenError as error:
            viewer.fault(Fault("taken", str(error), please.id))

    def _pass_on(self, viewer: Viewer, id: int, request: Request, now: float) -> None:
        match request:
            case Step():
                self._check_step(viewer, request, now)
            case LoadScenario(name=name) if name not in self._scenarios:
                raise AutodriveError(f"scenario '{name[:80]}' is not known. {suggest(name, list(self._scenarios))}")
            case _:
                pass
        future = self._simulation.request(request, here=True)
        self._note_begin(request)
        viewer.pending += 1

        def tell(done: Future[Frame]) -> None:
            viewer.pending -= 1
            self._note_end(request)
            if done.cancelled():
                viewer.fault(Fault("request", "the simulation has ended", id))
            elif error := done.exception():
                viewer.fault(Fault("request", str(error), id))
            else:
                viewer.done(id, done.result())

        self._mail.when_carried(future, tell)
        if future.done():
            self._mail.deliver()

    def _check_step(self, viewer: Viewer, step: Step, now: float) -> None:
        if not (self._will_pause[-1] if self._will_pause else self._simulation.is_paused):
            raise AutodriveError(NOT_PAUSED)
        if step.ticks > TICKS:
            raise AutodriveError(f"a Step over the wire runs at most {TICKS} ticks, not {step.ticks}: ask for several")
        holders = self._seats.drivers(now)
        for vehicle in step.commands:
            if holders.get(vehicle, viewer) is not viewer:
                raise _TakenError(_taken(vehicle, holders[vehicle]))
        for vehicle in step.commands:
            self._seats.take(vehicle, viewer, "script", None, now)
            if vehicle not in holders:
                self._show_status()

    def _note_begin(self, request: Request) -> None:
        match request:
            case Step():
                self._mail.steps += 1
            case Pause() | Resume():
                self._will_pause.append(isinstance(request, Pause))
            case LoadScenario(name=name):
                self.note = f"loading the scenario {self._scenarios[name] or name}"
                self._show_status()
            case _:
                pass

    def _note_end(self, request: Request) -> None:
        match request:
            case Step():
                self._mail.steps -= 1
                return
            case Pause() | Resume():
                self._will_pause.pop(0)
            case LoadScenario():
                self.note = ""
            case _:
                pass
        self._show_status()

    # -- the bridge ---------------------------------------------------------------------------------------------

    def _connect(self, host: str, port: int) -> None:
        bridge = self._known_bridge()
        bridge.connect(host, port)
        if bridge.status == "closed":
            bridge.start()

    async def _disconnect(self, viewer: Viewer, id: int) -> None:
        try:
            await asyncio.to_thread(self._known_bridge().close)
        except AutodriveError as error:
            viewer.fault(Fault("request", str(error), id))
        else:
            viewer.done(id, self._simulation.frame)
        self._show_status()

    def _known_bridge(self) -> DevkitBridge:
        if self._bridge is None:
            raise AutodriveError("this simulator was started without a bridge to devkit scripts")
        return self._bridge

    def _begin(self, work: object) -> None:
        task = asyncio.create_task(work)  # type: ignore[arg-type]
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)


class _TakenError(Exception):
    """Somebody else holds the wheel."""


def _taken(vehicle: str, other: Viewer) -> str:
    return f"'{other.name}' drives vehicle '{vehicle}'"


def _wrong_mode(drive: Drive) -> str:
    if drive.source == "script":
        return f"vehicle '{drive.vehicle}' is in manual mode and obeys persons; a script drives it in autonomous mode"
    return f"vehicle '{drive.vehicle}' is in autonomous mode and obeys scripts; a person drives it in manual mode"
