"""Services of simulation_interfaces: features, reset, state, step, entities, worlds."""

from __future__ import annotations

import importlib
import re
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from autodrive import AutodriveError
from autodrive.base.transforms import rotate, yaw_from_quaternion
from autodrive.connect.ros.robot import quaternion
from autodrive.protocol.messages import Frame, LoadScenario, Pause, Pose, Reset, Resume, Step, Teleport
from autodrive.ros import Bridge, Time

MAX_STEPS = 100
"""Ticks in one request: each request has a timeout."""
STATE_TIMEOUT = 1.0
"""Time to wait until a change of state is reported [s]."""
WORLD_FRAMES = ("", "world", "map")
"""Frames of entity states; all are equal."""

SERVICES = {
    "get_simulator_features": ("GetSimulatorFeatures", "supported features"),
    "reset_simulation": ("ResetSimulation", "restores the initial state; time and state are always reset together"),
    "get_simulation_state": ("GetSimulationState", "stopped (paused after a reset), playing, paused, or no world"),
    "set_simulation_state": ("SetSimulationState", "stops, plays or pauses; quitting is not supported"),
    "step_simulation": ("StepSimulation", "runs this number of ticks; only while paused"),
    "get_entities": ("GetEntities", "vehicles, by their names in topics, and movable objects; can be filtered by name"),
    "get_entity_state": ("GetEntityState", "true pose and twist, in world"),
    "set_entity_state": ("SetEntityState", "teleports a vehicle to x, y and yaw, at rest"),
    "get_available_worlds": ("GetAvailableWorlds", "the scenarios of the simulator"),
    "load_world": ("LoadWorld", "loads the scenario whose name is the uri; it is stopped"),
    "get_current_world": ("GetCurrentWorld", "the current scenario"),
}
"""Name -> type in simulation_interfaces, and description."""

FEATURES = (
    "ENTITY_STATE_GETTING",
    "ENTITY_STATE_SETTING",
    "SIMULATION_RESET",
    "SIMULATION_RESET_TIME",
    "SIMULATION_RESET_STATE",
    "SIMULATION_STATE_GETTING",
    "SIMULATION_STATE_SETTING",
    "SIMULATION_STATE_PAUSE",
    "STEP_SIMULATION_SINGLE",
    "STEP_SIMULATION_MULTIPLE",
    "WORLD_LOADING",
    "WORLD_INFO_GETTING",
    "AVAILABLE_WORLDS",
)
"""Names in simulation_interfaces/SimulatorFeatures; older releases have fewer."""


def create_services(node: Node, bridge: Bridge, group: CallbackGroup) -> None:
    """Create the services; those whose type is not installed are left out with a warning."""
    try:
        types = importlib.import_module("simulation_interfaces.srv")
    except ImportError:
        node.get_logger().warning("no services: the package simulation_interfaces is not installed")
        return
    services = Services(bridge)
    for name, (type_, _) in SERVICES.items():
        if kind := getattr(types, type_, None):
            node.create_service(kind, name, services.callback(name), callback_group=group)
        else:
            node.get_logger().warning(f"no service {name}: this release of simulation_interfaces does not have it")


class ServiceError(Exception):
    """A refused call: a code of simulation_interfaces/Result, and a message."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


class Services:
    """Implements the services; each method has the name of its service."""

    def __init__(self, bridge: Bridge) -> None:
        messages = importlib.import_module("simulation_interfaces.msg")
        self._features = messages.SimulatorFeatures
        self._states = messages.SimulationState
        self._codes = messages.Result
        self._world_type = getattr(messages, "WorldResource", None)
        self._bridge = bridge
        self._is_stopped = False

    def callback(self, name: str) -> Callable[[Any, Any], Any]:
        """The callback of a service, which fills in the result."""
        serve = getattr(self, name)

        def answer(request: Any, response: Any) -> Any:
            code, text = self._codes.RESULT_OK, ""
            try:
                serve(request, response)
            except ServiceError as error:
                code, text = error.code, str(error)
            except (AutodriveError, OSError) as error:
                code, text = self._codes.RESULT_OPERATION_FAILED, str(error)
            if hasattr(response, "result"):
                response.result.result, response.result.error_message = code, text
            return response

        return answer

    # -- the simulation -------------------------------------------------------------------------------------------

    def get_simulator_features(self, _: Any, response: Any) -> None:
        """The features of `FEATURES` that this release of simulation_interfaces has."""
        found = [getattr(self._features, name, None) for name in FEATURES]
        response.features.features = [number for number in found if number is not None]
        response.features.custom_info = "AutoDRIVE Simulator"

    def reset_simulation(self, request: Any, _: Any) -> None:
        """Resets time and state together; there are no spawned entities."""
        if request.scope == request.SCOPE_SPAWNED:
            raise ServiceError(self._codes.RESULT_FEATURE_UNSUPPORTED, "spawned entities are not supported")
        self._bridge.request(Reset())

    def get_simulation_state(self, _: Any, response: Any) -> None:
        """State of the simulator, which another client may have paused."""
        response.state.state = self._state()

    def set_simulation_state(self, request: Any, response: Any) -> None:
        """Stopped means reset and paused."""
        states, wanted = self._states, request.state.state
        if wanted not in (states.STATE_STOPPED, states.STATE_PLAYING, states.STATE_PAUSED):
            raise ServiceError(self._codes.RESULT_FEATURE_UNSUPPORTED, "the state must be stopped, playing or paused")
        if wanted == self._state():
            raise ServiceError(response.ALREADY_IN_TARGET_STATE, "the simulation already has this state")
        self._bridge.request(Resume() if wanted == states.STATE_PLAYING else Pause())
        if wanted == states.STATE_STOPPED:
            self._bridge.request(Reset())
        self._is_stopped = wanted == states.STATE_STOPPED
        self._wait_for(lambda: self._state() == wanted)

    def step_simulation(self, request: Any, _: Any) -> None:
        """One step is one tick."""
        self._now()
        if not self._is_paused:
            raise ServiceError(self._codes.RESULT_OPERATION_FAILED, "the simulation must be paused")
        self._is_stopped = False
        remaining = request.steps
        while remaining:
            self._bridge.request(Step(min(remaining, MAX_STEPS)))
            remaining -= min(remaining, MAX_STEPS)

    # -- entities -------------------------------------------------------------------------------------------------

    def get_entities(self, request: Any, response: Any) -> None:
        """Vehicles and objects whose names match the filter."""
        filters, names = request.filters, [*self._vehicles(), *self._now().objects]
        if filters.categories or filters.tags.tags or filters.bounds.points:
            raise ServiceError(self._codes.RESULT_FEATURE_UNSUPPORTED, "entities can be filtered by name only")
        try:
            response.entities = [name for name in names if re.search(filters.filter, name)]
        except re.error as error:
            raise ServiceError(self._codes.RESULT_OPERATION_FAILED, f"filter '{filters.filter}': {error}") from None

    def get_entity_state(self, request: Any, response: Any) -> None:
        """State of a vehicle or an object; objects have no twist."""
        frame, vehicles, name = self._now(), self._vehicles(), request.entity
        if name not in vehicles and name not in frame.objects:
            raise self._not_found(name)
        pose = frame.vehicles[vehicles[name]].pose if name in vehicles else frame.objects[name].pose
        state = response.state
        state.header.frame_id = "world"
        state.header.stamp.sec, state.header.stamp.nanosec = Time.of(frame.time)
        _fill_pose(state.pose, pose)
        if name in vehicles:
            vehicle = frame.vehicles[vehicles[name]]
            _fill(state.twist.linear, rotate(pose.orientation, vehicle.velocity))
            _fill(state.twist.angular, rotate(pose.orientation, vehicle.angular_velocity))

    def set_entity_state(self, request: Any, _: Any) -> None:
        """Teleport a vehicle; height, roll and pitch follow from the ground."""
        vehicles, state = self._vehicles(), request.state
        unsupported = self._codes.RESULT_FEATURE_UNSUPPORTED
        if request.entity in self._now().objects:
            raise ServiceError(unsupported, f"'{request.entity}' is an object; only vehicles can be moved")
        if request.entity not in vehicles:
            raise self._not_found(request.entity)
        if state.header.frame_id not in WORLD_FRAMES:
            raise ServiceError(unsupported, f"the frame must be world or map, not '{state.header.frame_id}'")
        if any(getattr(of, axis) for of in (state.twist.linear, state.twist.angular) for axis in "xyz"):
            raise ServiceError(unsupported, "the twist must be 0")
        at, yaw = state.pose.position, yaw_from_quaternion(quaternion(state.pose.orientation))
        self._bridge.request(Teleport(vehicles[request.entity], at.x, at.y, yaw))

    # -- worlds ---------------------------------------------------------------------------------------------------

    def get_available_worlds(self, request: Any, response: Any) -> None:
        """The scenarios."""
        if request.filter.tags:
            raise ServiceError(self._codes.RESULT_FEATURE_UNSUPPORTED, "worlds have no tags")
        self._now()
        response.worlds = [self._world(name, title) for name, title in self._bridge.scenarios.items()]

    def load_world(self, request: Any, response: Any) -> None:
        """The uri is the name of a scenario."""
        if request.resource_string:
            raise ServiceError(response.UNSUPPORTED_FORMAT, "worlds cannot be sent as text: set uri to a scenario name")
        if not request.uri:
            raise ServiceError(response.NO_RESOURCE, "set uri to the name of a scenario: see get_available_worlds")
        self._now()
        if request.uri not in self._bridge.scenarios:
            known = ", ".join(self._bridge.scenarios)
            raise ServiceError(self._codes.RESULT_NOT_FOUND, f"scenario '{request.uri}' is not known. Known: {known}")
        self._bridge.request(Pause())
        self._bridge.request(LoadScenario(request.uri))
        self._bridge.request(Reset())
        self._is_stopped = True
        self._wait_for(lambda: self._is_stopped_in(request.uri))
        response.world = self._world(request.uri, self._bridge.scenarios[request.uri])

    def get_current_world(self, _: Any, response: Any) -> None:
        """The current scenario."""
        if self._bridge.scene is None:
            raise ServiceError(response.NO_WORLD_LOADED, "no simulator is connected")
        response.world = self._world(self._bridge.scene.scenario, self._bridge.scene.title)

    # -- parts ----------------------------------------------------------------------------------------------------

    @property
    def _is_paused(self) -> bool:
        return self._bridge.status is not None and self._bridge.status.is_paused

    def _state(self) -> int:
        if self._bridge.frame is None:
            return self._states.STATE_NO_WORLD
        if not self._is_paused:
            return self._states.STATE_PLAYING
        is_stopped = self._is_stopped and self._bridge.frame.tick == 0
        return self._states.STATE_STOPPED if is_stopped else self._states.STATE_PAUSED

    def _is_stopped_in(self, scenario: str) -> bool:
        scene = self._bridge.scene
        return scene is not None and scene.scenario == scenario and self._state() == self._states.STATE_STOPPED

    def _now(self) -> Frame:
        if self._bridge.frame is None:
            raise ServiceError(self._codes.RESULT_INCORRECT_STATE, "no simulator is connected")
        return self._bridge.frame

    def _vehicles(self) -> dict[str, str]:
        """Name in ROS -> name in the simulator."""
        return {self._bridge.vehicle_name(vehicle): vehicle for vehicle in self._now().vehicles}

    def _not_found(self, name: str) -> ServiceError:
        known = ", ".join([*self._vehicles(), *self._now().objects])
        return ServiceError(self._codes.RESULT_NOT_FOUND, f"entity '{name}' is not known. Known: {known}")

    def _world(self, name: str, title: str) -> Any:
        assert self._world_type is not None
        world = self._world_type(name=name, description=title)
        world.world_resource.uri = name
        return world

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        """Changes are reported with the next Frame."""
        deadline = time.monotonic() + STATE_TIMEOUT
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.005)


def _fill(vector: Any, values: Any) -> None:
    vector.x, vector.y, vector.z = map(float, values)


def _fill_pose(pose: Any, source: Pose) -> None:
    _fill(pose.position, source.position)
    q = pose.orientation
    q.w, q.x, q.y, q.z = map(float, source.orientation)
