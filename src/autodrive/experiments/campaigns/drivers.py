"""Drivers of a run: a class of the user, a policy, or a devkit script in a process of its own."""

from __future__ import annotations

import functools
import shlex
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

from msgspec.structs import replace

from autodrive.base.errors import AutodriveError, CommandError
from autodrive.graphics.cameras.worker import environment
from autodrive.protocol.messages import Command, Frame, Hold, Operation

if TYPE_CHECKING:
    from autodrive.connect.bridge.devkit import DevkitBridge
    from autodrive.experiments.campaigns.scene import Scene
    from autodrive.experiments.policies.policy import Policy

Commands: TypeAlias = Mapping[str, Command] | Command | None
OWN = "V1"
"""Name of the vehicle for a devkit script."""
CHECK_INTERVAL = 0.2
"""Wall time between two looks at whether a devkit script still runs [s]."""


class Driver(Protocol):
    """What the class of a user has. A new one is made for each run; `driver.NAME` are arguments of the class."""

    def reset(self, scene: Scene) -> None:
        """Called once, before the first Frame."""
        ...

    def act(self, frame: Frame) -> Commands:
        """Commands by vehicle, or that of the campaign's vehicle; None: the last ones, until their time-out."""
        ...


class DriverError(Exception):
    """A driver did something that ends the run."""


class PolicyDriver:
    """A policy drives by what a script may read in a race (`experiments.policies`). Each run begins with a new one."""

    def __init__(self, file: Path) -> None:
        """Raises `AutodriveError` if the file is no policy, or the policy needs other readings."""
        from autodrive.experiments.policies.racer import PERIOD, PolicyRacer  # noqa: PLC0415  only this driver needs it

        self._racer, self._period = PolicyRacer(_policy(file)), PERIOD
        self._command = Command()

    def reset(self, scene: Scene) -> None:
        """Look at the tick. Raises `AutodriveError` if scans do not come at equal distances in it."""
        self._vehicle = scene.vehicle
        self._ticks = round(self._period / scene.scenario.tick)
        if abs(self._ticks * scene.scenario.tick - self._period) > 1e-9:
            raise AutodriveError(
                f"a policy drives each {self._period:g} s, which must be a multiple of the scenario's tick, such as "
                f"tick: 0.005; it is {scene.scenario.tick:g}"
            )

    def act(self, frame: Frame) -> Commands:
        """A new command for each scan, between them the last one."""
        if frame.tick % self._ticks == 0:
            self._command = self._racer.act(frame.vehicles[self._vehicle])
        return self._command


@functools.cache
def _policy(file: Path) -> Policy:
    from autodrive.experiments.policies.policy import Policy  # noqa: PLC0415  only this driver needs it

    return Policy.load(file)


class DevkitScript:
    """A devkit script in lock-step: each Frame waits for its answer. It drives its vehicle as V1."""

    def __init__(self, command: str, folder: Path) -> None:
        """`command`: its command line with '{port}'; it runs in `folder`."""
        self._command, self._folder = command, folder
        self._process: subprocess.Popen[bytes] | None = None
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115  `close` closes it
        self._bridge: DevkitBridge | None = None
        self._sinks: tuple[DevkitBridge, ...] = ()
        self._answer: Command | None = None
        self._news = threading.Condition()
        self._vehicle = ""
        self._frame: Frame | None = None

    def reset(self, scene: Scene) -> None:
        """Remember the vehicle; the script starts with the first Frame."""
        self._vehicle = scene.vehicle
        self._profile = scene.vehicles[scene.vehicle].devkit_profile

    def act(self, frame: Frame) -> Commands:
        """The answer of the script. Raises `DriverError` if it ends."""
        self._frame = replace(frame, vehicles={OWN: frame.vehicles[self._vehicle]}, objects={}, events=())
        self._answer = None
        if self._process is None:
            self._start()  # the bridge sends the present Frame when the script is there
        for sink in self._sinks:
            sink.publish(self._frame)
        assert self._process is not None
        with self._news:
            while not self._news.wait_for(lambda: self._answer is not None, CHECK_INTERVAL):
                if self._process.poll() is not None:
                    raise DriverError(f"the script ended with exit code {self._process.returncode}{self._last_line()}")
        return self._answer

    def close(self) -> None:
        """End the script."""
        if self._bridge is not None:
            self._bridge.close()
        if self._process is not None:
            self._process.kill()
            self._process.wait()
        self._messages.close()

    def _start(self) -> None:
        from autodrive.connect.bridge.devkit import DevkitBridge  # noqa: PLC0415  only this driver needs it

        with socket.create_server(("127.0.0.1", 0)) as listener:
            port = listener.getsockname()[1]
        line = [sys.executable if one == "python" else one for one in shlex.split(self._command.format(port=port))]
        try:
            self._process = subprocess.Popen(
                line,
                cwd=self._folder,
                env=environment(),
                stdin=subprocess.DEVNULL,
                stdout=self._messages,
                stderr=subprocess.STDOUT,
            )
        except OSError as error:
            raise DriverError(f"the script cannot be started: {error.strerror}: {line[0]}") from None
        self._bridge = DevkitBridge(self, "127.0.0.1", port, vehicle_profile=lambda: self._profile)
        self._bridge.start()

    def _last_line(self) -> str:
        self._messages.seek(0)
        lines = self._messages.read().decode("utf-8", "replace").strip().splitlines()
        return f": {lines[-1][:200]}" if lines else ""

    # -- towards the bridge, in its thread -------------------------------------------------------------------------

    @property
    def frame(self) -> Frame:
        """The present Frame."""
        assert self._frame is not None
        return self._frame

    def submit(self, vehicle: str, command: Command) -> None:
        """Take the answer of the script."""
        with self._news:
            self._answer = command
            self._news.notify_all()

    def request(self, request: Operation) -> object:
        """Refuse resets and poses: they are those of the campaign."""
        if not (isinstance(request, Hold) and request.position is None):
            raise CommandError("a script cannot reset or move its vehicle in a campaign")
        return None

    def add_sink(self, sink: DevkitBridge) -> None:
        """Tell the bridge about each Frame."""
        self._sinks = (*self._sinks, sink)

    def remove_sink(self, sink: DevkitBridge) -> None:
        """Stop telling it."""
        self._sinks = tuple(one for one in self._sinks if one is not sink)
