"""Drivers of a run: a class of the user, a policy, or a devkit script in a process of its own."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, TypeAlias

from autodrive.base.errors import AutodriveError
from autodrive.protocol.messages import Command, Frame

if TYPE_CHECKING:
    from autodrive.connect.bridge.devkit import DevkitBridge
    from autodrive.connect.bridge.one_vehicle import OneVehicle
    from autodrive.connect.bridge.script_process import ScriptProcess
    from autodrive.experiments.campaigns.scene import RunScene
    from autodrive.experiments.policies.policy import Policy

Commands: TypeAlias = Mapping[str, Command] | Command | None
CHECK_INTERVAL = 0.2
"""Wall time between two looks at whether a devkit script still runs [s]."""


class Driver(Protocol):
    """What the class of a user has. A new one is made for each run; `driver.NAME` are arguments of the class."""

    def reset(self, scene: RunScene) -> None:
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

    def reset(self, scene: RunScene) -> None:
        """Look at the tick. Raises `AutodriveError` if scans do not come at equal distances in it."""
        self._vehicle = scene.vehicle
        self._ticks = round(self._period / scene.scenario.tick)
        if abs(self._ticks * scene.scenario.tick - self._period) > 1e-9:
            raise AutodriveError(
                f"a policy drives each {self._period:g} s, which must be a multiple of the scenario's tick, such as "
                f"tick: 0.005; the tick of this scenario is {scene.scenario.tick:g} s"
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
        self._process: ScriptProcess | None = None
        self._messages = tempfile.TemporaryFile()  # noqa: SIM115  `close` closes it
        self._bridge: DevkitBridge | None = None
        self._seat: OneVehicle | None = None
        self._vehicle = ""

    def reset(self, scene: RunScene) -> None:
        """Remember the vehicle; the script starts with the first Frame."""
        self._vehicle = scene.vehicle
        self._profile = scene.vehicles[scene.vehicle].devkit_profile

    def act(self, frame: Frame) -> Commands:
        """The answer of the script. Raises `DriverError` if it ends."""
        if self._seat is None:
            self._seat, before = self._start(frame), 0  # the bridge sends this Frame when the script is there
        else:
            before = self._seat.answers
            self._seat.publish(frame)
        assert self._process is not None
        while not self._seat.wait_for_answer(before, CHECK_INTERVAL):
            if end := self._process.end:
                raise DriverError(end)
        return self._seat.command

    def close(self) -> None:
        """End the script."""
        if self._bridge is not None:
            self._bridge.close()
        if self._process is not None:
            self._process.close()
        self._messages.close()

    def _start(self, frame: Frame) -> OneVehicle:
        from autodrive.connect.bridge.devkit import DevkitBridge  # noqa: PLC0415  only this driver needs it
        from autodrive.connect.bridge.one_vehicle import OneVehicle  # noqa: PLC0415  likewise
        from autodrive.connect.bridge.script_process import ScriptProcess  # noqa: PLC0415  likewise

        try:
            self._process = ScriptProcess(self._command, self._folder, self._messages)
        except AutodriveError as error:
            raise DriverError(str(error)) from None
        seat = OneVehicle(self._vehicle, frame)
        self._bridge = DevkitBridge(seat, "127.0.0.1", self._process.port, vehicle_profile=lambda: self._profile)
        self._bridge.start()
        return seat
