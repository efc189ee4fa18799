"""Services after simulation_interfaces: features, reset, state, step, entities, worlds."""

from __future__ import annotations

import importlib
import math
import re
import time
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node

from autodrive.errors import AutodriveError
from autodrive.protocol.messages import Frame, LoadScenario, Pause, Pose, Reset, Resume, Step, Teleport
from autodrive.ros import Bridge, Time
from autodrive.transforms import rotate

STEPS = 100
"""Ticks asked for at once: each request has to be answered within a time."""
SWITCH = 1.0
"""So long a change of state may take to be told [s]."""
WORLD_FRAMES = ("", "world", "map")
"""Frames in which states are told and set; all are the same."""

SERVICES = {
    "get_simulator_features": ("GetSimulatorFeatures", "what of this there is"),
    "reset_simulation": ("ResetSimulation", "the initial state; time and state are always reset together"),
    "get_simulation_state": ("GetSimulationState", "stopped (paused, as reset), playing, paused, or no world"),
    "set_simulation_state": ("SetSimulationState", "stops, plays, pauses; does not quit"),
    "step_simulation": ("StepSimulation", "runs that many ticks; only while paused"),
    "get_entities": ("GetEntities", "vehicles, by their names in topics, and movable objects; filtered by name"),
    "get_entity_state": ("GetEntityState", "true pose and twist, in world"),
    "set_entity_state": ("SetEntityState", "puts a vehicle there, at rest, by x, y and yaw"),
    "get_available_worlds": ("GetAvailableWorlds", "the scenarios of the simulator"),
    "load_world": ("LoadWorld", "goes over to the scenario whose name is the uri, stopped"),
    "get_current_world": ("GetCurrentWorld", "the scenario that runs"),
}
"""Name -> type of simulation_interfaces, and what it does."""

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
"""Names in simulation_interfaces/SimulatorFeatures; an older one may lack some."""


def offer(node: Node, bridge: Bridge, group: CallbackGroup) -> None:
    """Create them at the node; those whose type is not installed are left out, and that is told."""
    try:
        types = importlib.import_module("simulation_interfaces.srv")
    except ImportError:
        node.get_logger().warning("without services: the package simulation_interfaces is missing")
        return
    services = Services(bridge)
    for name, (type_, _) in SERVICES.items():
        if kind := getattr(types, type_, None):
            node.create_service(kind, name, services.answering(name), callback_group=group)
        else:
            node.get_logger().warning(f"without service {name}: simulation_interfaces is too old for it")


class NotDoneError(Exception):
    """Why something was not done: a code of simulation_interfaces/Result, and words."""

    def __init__(self, code: int, text: str) -> None:
        super().__init__(text)
        self.code = code


class Services:
    """What is called of them; a method has the name of the service."""

    def __init__(self, bridge: Bridge) -> None:
        messages = importlib.import_module("simulation_interfaces.msg")
        self._features = messages.SimulatorFeatures
        self._states = messages.SimulationState
        self._codes = messages.Result
        self._world_type = getattr(messages, "WorldResource", None)
        self._bridge = bridge
        self._is_stopped = False

    def answering(self, name: str) -> Callable[[Any, Any], Any]:
        """That service, with its result filled in."""
        serve = getattr(self, name)

        def answer(request: Any, response: Any) -> Any:
            code, text = self._codes.RESULT_OK, ""
            try:
                serve(request, response)
            except NotDoneError as error:
                code, text = error.code, str(error)
            except (AutodriveError, OSError) as error:
                code, text = self._codes.RESULT_OPERATION_FAILED, str(error)
            if hasattr(response, "result"):
                response.result.result, response.result.error_message = code, text
            return response

        return answer

    # -- the simulation -------------------------------------------------------------------------------------------

    def get_simulator_features(self, _: Any, response: Any) -> None:
        """Those of `FEATURES`."""
        found = [getattr(self._features, name, None) for name in FEATURES]
        response.features.features = [number for number in found if number is not None]
        response.features.custom_info = "AutoDRIVE Simulator"

    def reset_simulation(self, request: Any, _: Any) -> None:
        """Time and state go together, and nothing is ever spawned."""
        if request.scope == request.SCOPE_SPAWNED:
            raise NotDoneError(self._codes.RESULT_FEATURE_UNSUPPORTED, "nothing can be spawned, so nothing is removed")
        self._bridge.ask(Reset())

    def get_simulation_state(self, _: Any, response: Any) -> None:
        """Of the simulator as it is: somebody else may have paused it."""
        response.state.state = self._state()

    def set_simulation_state(self, request: Any, response: Any) -> None:
        """Stopped is paused and reset."""
        states, wanted = self._states, request.state.state
        if wanted not in (states.STATE_STOPPED, states.STATE_PLAYING, states.STATE_PAUSED):
            raise NotDoneError(self._codes.RESULT_FEATURE_UNSUPPORTED, "it can be stopped, played or paused")
        if wanted == self._state():
            raise NotDoneError(response.ALREADY_IN_TARGET_STATE, "it is so already")
        self._bridge.ask(Resume() if wanted == states.STATE_PLAYING else Pause())
        if wanted == states.STATE_STOPPED:
            self._bridge.ask(Reset())
        self._is_stopped = wanted == states.STATE_STOPPED
        self._await(lambda: self._state() == wanted)

    def step_simulation(self, request: Any, _: Any) -> None:
        """Each step is a tick."""
        self._now()
        if not self._is_paused:
            raise NotDoneError(self._codes.RESULT_OPERATION_FAILED, "steps need a paused simulation, and it plays")
        self._is_stopped = False
        left = request.steps
        while left:
            self._bridge.ask(Step(min(left, STEPS)))
            left -= min(left, STEPS)

    # -- entities -------------------------------------------------------------------------------------------------

    def get_entities(self, request: Any, response: Any) -> None:
        """Vehicles and objects whose name has the filter in it."""
        filters, names = request.filters, [*self._vehicles(), *self._now().objects]
        if filters.categories or filters.tags.tags or filters.bounds.points:
            raise NotDoneError(self._codes.RESULT_FEATURE_UNSUPPORTED, "entities can be filtered by name only")
        try:
            response.entities = [name for name in names if re.search(filters.filter, name)]
        except re.error as error:
            raise NotDoneError(self._codes.RESULT_OPERATION_FAILED, f"filter '{filters.filter}': {error}") from None

    def get_entity_state(self, request: Any, response: Any) -> None:
        """Of a vehicle or an object; of an object no twist is known."""
        frame, vehicles, name = self._now(), self._vehicles(), request.entity
        if name not in vehicles and name not in frame.objects:
            raise self._not_found(name)
        thing = frame.vehicles[vehicles[name]] if name in vehicles else frame.objects[name]
        state = response.state
        state.header.frame_id = "world"
        state.header.stamp.sec, state.header.stamp.nanosec = Time.of(frame.time)
        _fill_pose(state.pose, thing.pose)
        if name in vehicles:
            _fill(state.twist.linear, rotate(thing.pose.orientation, thing.velocity))
            _fill(state.twist.angular, rotate(thing.pose.orientation, thing.angular_velocity))

    def set_entity_state(self, request: Any, _: Any) -> None:
        """A vehicle is put down at rest; height, roll and pitch are those of the ground."""
        vehicles, state = self._vehicles(), request.state
        unsupported = self._codes.RESULT_FEATURE_UNSUPPORTED
        if request.entity in self._now().objects:
            raise NotDoneError(unsupported, f"'{request.entity}' is an object; only vehicles can be put elsewhere")
        if request.entity not in vehicles:
            raise self._not_found(request.entity)
        if state.header.frame_id not in WORLD_FRAMES:
            raise NotDoneError(unsupported, f"a state must be in world or map, not in '{state.header.frame_id}'")
        if any(getattr(of, axis) for of in (state.twist.linear, state.twist.angular) for axis in "xyz"):
            raise NotDoneError(unsupported, "a vehicle is put down at rest: the twist must be 0")
        q, at = state.pose.orientation, state.pose.position
        yaw = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        self._bridge.ask(Teleport(vehicles[request.entity], at.x, at.y, yaw))

    # -- worlds ---------------------------------------------------------------------------------------------------

    def get_available_worlds(self, request: Any, response: Any) -> None:
        """The scenarios."""
        if request.filter.tags:
            raise NotDoneError(self._codes.RESULT_FEATURE_UNSUPPORTED, "worlds have no tags")
        self._now()
        response.worlds = [self._world(name, title) for name, title in self._bridge.scenarios.items()]

    def load_world(self, request: Any, response: Any) -> None:
        """The uri is a scenario's name."""
        if request.resource_string:
            raise NotDoneError(response.UNSUPPORTED_FORMAT, "name a scenario in uri: worlds cannot be sent as text")
        if not request.uri:
            raise NotDoneError(response.NO_RESOURCE, "name a scenario in uri: see get_available_worlds")
        self._now()
        if request.uri not in self._bridge.scenarios:
            known = ", ".join(self._bridge.scenarios)
            raise NotDoneError(self._codes.RESULT_NOT_FOUND, f"no scenario '{request.uri}'; there are {known}")
        self._bridge.ask(Pause())
        self._bridge.ask(LoadScenario(request.uri))
        self._bridge.ask(Reset())
        self._is_stopped = True
        self._await(lambda: self._is_at_the_beginning_of(request.uri))
        response.world = self._world(request.uri, self._bridge.scenarios[request.uri])

    def get_current_world(self, _: Any, response: Any) -> None:
        """The scenario."""
        if self._bridge.scene is None:
            raise NotDoneError(response.NO_WORLD_LOADED, "there is no simulator")
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

    def _is_at_the_beginning_of(self, scenario: str) -> bool:
        scene = self._bridge.scene
        return scene is not None and scene.scenario == scenario and self._state() == self._states.STATE_STOPPED

    def _now(self) -> Frame:
        if self._bridge.frame is None:
            raise NotDoneError(self._codes.RESULT_INCORRECT_STATE, "there is no simulator")
        return self._bridge.frame

    def _vehicles(self) -> dict[str, str]:
        """Name in ROS -> name in the simulator."""
        return {self._bridge.name(vehicle): vehicle for vehicle in self._now().vehicles}

    def _not_found(self, name: str) -> NotDoneError:
        known = ", ".join([*self._vehicles(), *self._now().objects])
        return NotDoneError(self._codes.RESULT_NOT_FOUND, f"there is no '{name}', but {known}")

    def _world(self, name: str, title: str) -> Any:
        assert self._world_type is not None
        world = self._world_type(name=name, description=title)
        world.world_resource.uri = name
        return world

    def _await(self, condition: Callable[[], bool]) -> None:
        """What was changed is told by the simulator a moment later, with the next Frame."""
        deadline = time.monotonic() + SWITCH
        while not condition() and time.monotonic() < deadline:
            time.sleep(0.005)


def _fill(vector: Any, values: Any) -> None:
    vector.x, vector.y, vector.z = map(float, values)


def _fill_pose(pose: Any, of: Pose) -> None:
    _fill(pose.position, of.position)
    turn = pose.orientation
    turn.w, turn.x, turn.y, turn.z = map(float, of.orientation)
