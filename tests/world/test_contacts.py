"""Contact forces and collision shapes of a world, compared with the laws of mechanics and with the State."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import autodrive
from autodrive import Command
from autodrive.base.transforms import inverse, rotate
from autodrive.physics.state import numbers
from autodrive.scenario import ScenarioSpec, VehiclePlacement
from autodrive.world import World
from autodrive.world.contacts import shapes_of

GRAVITY = 9.81
FULL = {"V1": Command(throttle=1.0)}


def total(world: World, *, of_wheels: bool) -> Any:
    """Sum of the forces on the wheels of V1, or on its body, in the vehicle frame [N]."""
    forces = world.contact_forces["V1"]
    is_chosen = [part.endswith(("left", "right")) == of_wheels for part in forces.parts]
    return forces.force[is_chosen].sum(axis=0)


@pytest.mark.parametrize("kind", ["nigel", "roboracer"])
def test_at_rest_the_ground_carries_the_weight_below_the_wheels(kind: str) -> None:
    world = autodrive.make(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=kind)}))
    world.watch_contacts()
    for _ in range(100):
        world.step()
    mass = float(world.compiled.model.vehicles["mass"][0])
    forces = world.contact_forces["V1"]
    assert forces.parts == ("front_left", "front_right", "rear_left", "rear_right")
    pose = world.frame.vehicles["V1"].pose
    weight = rotate(inverse(pose.orientation), (0.0, 0.0, mass * GRAVITY))
    np.testing.assert_allclose(forces.force.sum(axis=0), weight, atol=2e-3 * mass * GRAVITY)
    heights = [pose.position[2] + rotate(pose.orientation, place)[2] for place in forces.position]
    np.testing.assert_allclose(heights, 0.0, atol=1e-3)  # on the ground


def test_in_a_steady_turn_the_tyres_give_the_centripetal_force() -> None:
    world = autodrive.make("plane")
    world.watch_contacts()
    frame = world.frame
    for _ in range(400):
        frame = world.step({"V1": Command(throttle=0.6, steering=0.6)})
    vehicle, of = frame.vehicles["V1"], world.compiled.model.vehicles[0]
    at_centre = vehicle.velocity + np.cross(vehicle.angular_velocity, of["center_of_mass"])
    centripetal = of["mass"] * vehicle.angular_velocity[2] * np.array([-at_centre[1], at_centre[0]])
    drag = of["mass"] * of["drag"] * at_centre[:2]
    force = total(world, of_wheels=True)[:2]
    # the car nods and rolls a little
    np.testing.assert_allclose(force, centripetal + drag, atol=0.03 * float(np.linalg.norm(centripetal)))
    assert force[1] > 0.0  # to the left, as the turn


def test_a_wall_pushes_back_with_the_force_of_the_tyres() -> None:
    world = autodrive.make(ScenarioSpec(map="mini_map"))
    world.watch_contacts()
    frame = world.frame
    for _ in range(1000):
        frame = world.step(FULL)
    assert abs(frame.vehicles["V1"].speed) < 1e-3
    push, tyres = total(world, of_wheels=False), total(world, of_wheels=True)
    assert np.linalg.norm(tyres[:2]) > 1.0
    np.testing.assert_allclose(push[:2], -tyres[:2], atol=0.03 * float(np.linalg.norm(tyres[:2])))  # at rest
    forces = world.contact_forces["V1"]
    walls = [k for k, part in enumerate(forces.parts) if not part.endswith(("left", "right"))]
    assert all(forces.position[k][0] > world.vehicle_specs["V1"].wheelbase for k in walls)  # at the front of the car


def test_two_cars_push_each_other_with_opposite_forces() -> None:
    starts = {"V1": VehiclePlacement(), "V2": VehiclePlacement(x=0.6)}
    world = autodrive.make(ScenarioSpec(vehicles=starts))
    world.watch_contacts()
    found = 0
    for _ in range(300):
        frame = world.step(FULL)
        in_map = {
            name: [
                rotate(frame.vehicles[name].pose.orientation, force)
                for part, force in zip(of.parts, of.force, strict=True)
                if part in frame.vehicles
            ]
            for name, of in world.contact_forces.items()
        }
        assert len(in_map["V1"]) == len(in_map["V2"])
        if in_map["V1"]:
            found += 1
            (one,), (other,) = (np.sum(in_map[name], axis=0, keepdims=True) for name in ("V1", "V2"))
            np.testing.assert_allclose(one, -other, atol=1e-9 * float(np.linalg.norm(one)))
            assert one[0] < 0.0
    assert found > 10


def test_watching_changes_no_result_and_ends() -> None:
    worlds = [autodrive.make("boxes"), autodrive.make("boxes")]
    worlds[1].watch_contacts()
    for _ in range(200):
        for world in worlds:
            world.step(FULL)
    one, other = (numbers(world.compiled.state) for world in worlds)
    assert one.tobytes() == other.tobytes()
    assert worlds[0].contact_forces == {}
    assert worlds[1].contact_forces
    worlds[1].watch_contacts(False)
    assert worlds[1].contact_forces == {}
    worlds[1].step()
    assert worlds[1].contact_forces == {}


def test_shapes_are_where_the_state_has_them() -> None:
    world = autodrive.make("mini_map")
    for _ in range(20):
        frame = world.step(FULL)
    frame = world.frame
    found, state, model = shapes_of(world.compiled), world.compiled.state, world.compiled.model.shapes
    assert len(found.fixed.kind) == model.n_fixed > 0
    np.testing.assert_array_equal(found.fixed.position, state.shape_position[: model.n_fixed])
    placed = []
    for name, shapes in found.bodies.items():
        pose = (frame.vehicles if name in frame.vehicles else frame.objects)[name].pose
        placed += [pose.position + rotate(pose.orientation, place) for place in shapes.position]
    expected = state.shape_position[model.n_fixed :]
    assert len(placed) == len(expected)
    distances = np.linalg.norm(np.array(placed)[:, None] - expected[None], axis=2)
    assert distances.min(axis=0).max() < 1e-9
    for name, box in world.boxes.items():
        np.testing.assert_allclose(found.bodies[name].size, [np.array(box.size) / 2.0])
    for name, camera in world.vehicle_specs["V1"].cameras.items():
        np.testing.assert_allclose(found.sensors["V1"][name].position, camera.mount.position)
