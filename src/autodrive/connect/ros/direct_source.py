"""Native-protocol source: Frames, scans and images with simulated time stamps, commands and requests."""

from __future__ import annotations

import dataclasses
import threading
from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from autodrive.base.errors import CommandError
from autodrive.connect.client import Client, NoSimulatorError
from autodrive.connect.ros.config import Config
from autodrive.connect.ros.source import Listener, Update, VehicleInfo
from autodrive.protocol.messages import Command, Frame, LidarScan, Operation
from autodrive.protocol.native import Picture, Scene, Status

POLL_INTERVAL = 0.2
"""Interval at which the source checks whether the listener is closed while no data come, as in a pause [s]."""


class DirectSource:
    """Reads with one connection; sends commands and requests with another, so that neither blocks the other."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._lock = threading.Lock()
        self._sender: Client | None = None
        self._simulator = config.simulator
        self.scene: Scene | None = None
        self.status: Status | None = None
        self.frame: Frame | None = None
        self.scenarios: dict[str, str] = {}

    def serve(self, listener: Listener) -> None:
        """Run until the listener is closed. Raises `NoSimulatorError` if no simulator is found or it is lost."""
        config = self._config
        scans: dict[str, LidarScan] = {}
        pictures: dict[tuple[str, str], Picture] = {}
        quality = config.picture_quality
        with Client(
            config.simulator, **self._named(), frame_rate=config.rate, picture_quality=quality, patience=0.0
        ) as sim:
            self._simulator = str(sim.connection.address)  # the commands go to the same one
            sim.connection.subscribe(replace(sim.connection.subscription, frames_of_readings=True))
            while not listener.is_closed:
                rate = max(config.rate, config.clock_rate) if listener.wants_clock else config.rate
                sim.set_rates(rate, config.picture_rate if listener.wants_images else 0.0)
                try:
                    view = sim.wait_news(min(listener.max_wait, POLL_INTERVAL))
                except TimeoutError:
                    self.status = sim.status  # another client may have paused the simulation
                    listener.on_idle()
                    continue
                if view.scene is not None and view.scene is not self.scene:
                    self.scene, self.scenarios, scans, pictures = view.scene, sim.scenarios, {}, {}
                    listener.on_vehicles(self._described(sim, view.scene, listener))
                if (frame := view.frame) is None:
                    continue
                new_scans, new_pictures = _news(view.scans, scans, frame), _news(view.pictures, pictures, frame)
                update = Update(frame, new_scans, new_pictures, is_new=view.is_new)
                self.frame, self.status = view.read(), view.status
                listener.on_update(update)

    def drive(self, vehicle: str, command: Command) -> None:
        """Send a command. Raises `AutodriveError`, also for a refusal of an earlier command."""
        self._send(lambda sim: sim.drive(vehicle, command))

    def request(self, request: Operation) -> Frame:
        """The Frame after the request. Raises `AutodriveError`."""
        return self._send(lambda sim: sim.ask(request))

    def close(self) -> None:
        """Close the sending connection."""
        with self._lock:
            if self._sender is not None:
                self._sender.close()
                self._sender = None

    def _described(self, sim: Client, scene: Scene, listener: Listener) -> dict[str, VehicleInfo]:
        """The vehicles of the Scene with their URDF."""
        infos = vehicle_infos(scene)
        try:
            return {name: dataclasses.replace(info, urdf=sim.urdf(name)) for name, info in infos.items()}
        except CommandError as error:  # of an older simulator
            listener.warn(f"the simulator does not describe its vehicles: no frames of sensors and wheels ({error})")
            return infos

    def _send(self, send: Callable[[Client], Any]) -> Any:
        with self._lock:
            try:
                if self._sender is None:
                    self._sender = Client(self._simulator, **self._named(), frame_rate=0.0, scans=False, patience=0.0)
                return send(self._sender)
            except (NoSimulatorError, TimeoutError):
                if self._sender is not None:
                    self._sender.close()
                    self._sender = None
                raise

    def _named(self) -> dict[str, Any]:
        return {"token": self._config.token or None, "name": "ROS"}


def vehicle_infos(scene: Scene) -> dict[str, VehicleInfo]:
    """The vehicles of a Scene without those of the traffic, by name."""
    return {
        name: VehicleInfo(
            number,
            vehicle.type,
            tuple(vehicle.cameras),
            vehicle.wheelbase,
            vehicle.wheel_radius,
            vehicle.speed_limit,
            vehicle.steering_limit,
            vehicle.sensor_noise,
            vehicle.missing_gravity,
        )
        for number, (name, vehicle) in enumerate(scene.vehicles.items(), start=1)
        if not vehicle.is_traffic  # they come last
    }


def _news(latest: dict[Any, Any], known: dict[Any, Any], frame: Frame) -> dict[Any, Any]:
    """Items of `latest` that differ from those in `known`, which is updated, and are not later than the Frame.

    A scan or picture comes before its Frame, in which the vehicle has the pose of that time.
    """
    news = {key: value for key, value in latest.items() if known.get(key) is not value and value.time <= frame.time}
    known.update(news)
    return news
