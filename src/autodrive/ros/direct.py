"""The simulator by its own protocol: Frames, scans and pictures with their simulated times, and requests."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Protocol

from autodrive.client import Client, NoSimulatorError
from autodrive.protocol.messages import Command, Frame, LidarScan, Request
from autodrive.protocol.native import Picture, Scene, Status
from autodrive.ros.config import Config
from autodrive.ros.update import Car, Update

LOOK = 0.2
"""While no Frame comes, as in a pause, it is looked so often whether the node is to end [s]."""


class Listener(Protocol):
    """Who is told what the simulator says."""

    @property
    def wants_clock(self) -> bool:
        """Whether somebody reads the time."""
        ...

    @property
    def wants_pictures(self) -> bool:
        """Whether somebody reads them."""
        ...

    @property
    def patience(self) -> float:
        """How long the next Frame may take until `idle` is called [s]."""
        ...

    @property
    def is_ended(self) -> bool:
        """Whether it wants to hear no more."""
        ...

    def begin(self, cars: dict[str, Car]) -> None:
        """A simulator was found, or another scenario loaded."""
        ...

    def take(self, update: Update) -> None:
        """A new Frame."""
        ...

    def idle(self) -> None:
        """None has come."""
        ...

    def complain(self, text: str) -> None:
        """Something is wrong that a user should hear of."""
        ...


class DirectSource:
    """Reads with one connection, and drives and asks with another, so that neither waits for the other."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._lock = threading.Lock()
        self._driving: Client | None = None
        self.scene: Scene | None = None
        self.status: Status | None = None
        self.frame: Frame | None = None
        self.scenarios: dict[str, str] = {}

    def serve(self, listener: Listener) -> None:
        """Until the listener has ended. Raises `NoSimulatorError` when the simulator is lost, or cannot be found."""
        config = self._config
        scans: dict[str, LidarScan] = {}
        pictures: dict[tuple[str, str], Picture] = {}
        quality = config.picture_quality
        with Client(**self._address(), frame_rate=config.rate, picture_quality=quality, patience=0.0) as sim:
            while not listener.is_ended:
                rate = max(config.rate, config.clock_rate) if listener.wants_clock else config.rate
                sim.set_rates(rate, config.picture_rate if listener.wants_pictures else 0.0)
                try:
                    view = sim.wait_news(min(listener.patience, LOOK))
                except TimeoutError:
                    self.status = sim.status  # somebody may have paused it
                    listener.idle()
                    continue
                if view.scene is not None and view.scene is not self.scene:
                    self.scene, self.scenarios, scans, pictures = view.scene, sim.scenarios, {}, {}
                    listener.begin(_cars(view.scene))
                if (frame := view.frame) is None:
                    continue
                update = Update(frame, _news(view.scans, scans), _news(view.pictures, pictures), is_new=view.is_new)
                self.frame, self.status = view.taken(), view.status
                listener.take(update)

    def drive(self, vehicle: str, command: Command) -> None:
        """Raises `AutodriveError`, also for what was refused before."""
        self._with_client(lambda sim: sim.drive(vehicle, command))

    def ask(self, request: Request) -> Frame:
        """The Frame after it. Raises `AutodriveError`."""
        return self._with_client(lambda sim: sim.ask(request))

    def close(self) -> None:
        """End what is left."""
        with self._lock:
            if self._driving is not None:
                self._driving.close()
                self._driving = None

    def _with_client(self, do: Callable[[Client], Any]) -> Any:
        with self._lock:
            try:
                if self._driving is None:
                    self._driving = Client(**self._address(), frame_rate=0.0, scans=False, patience=0.0)
                return do(self._driving)
            except (NoSimulatorError, TimeoutError):
                if self._driving is not None:
                    self._driving.close()
                    self._driving = None
                raise

    def _address(self) -> dict[str, Any]:
        return {"address": self._config.address, "token": self._config.token or None, "name": "ROS"}


def _news(told: dict[Any, Any], known: dict[Any, Any]) -> dict[Any, Any]:
    """What is not known yet; from now on it is."""
    news = {key: value for key, value in told.items() if known.get(key) is not value}
    known.update(news)
    return news


def _cars(scene: Scene) -> dict[str, Car]:
    return {
        name: Car(
            number,
            one.type,
            tuple(one.cameras),
            one.wheelbase,
            one.wheel_radius,
            one.speed_limit,
            one.steering_limit,
            one.sensor_noise,
        )
        for number, (name, one) in enumerate(scene.vehicles.items(), start=1)
    }
