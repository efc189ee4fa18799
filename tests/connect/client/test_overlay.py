"""Collision shapes and contact forces, as a viewer of a real server gets them."""

from __future__ import annotations

import numpy as np

from autodrive.connect.client.client_socket import Address, ClientSocket
from autodrive.connect.server.server import SimulationServer
from autodrive.protocol.codec import decode_server, encode
from autodrive.protocol.messages import Frame, LoadScenario
from autodrive.protocol.native import PROTOCOL, Contacts, Hello, Scene, Shapes, Subscribe
from autodrive.world.contacts import shapes_of
from autodrive.world.simulation import Simulation
from tests.support.waiting import LIMIT, wait_until


class Watcher:
    """Keeps the messages that came."""

    def __init__(self, server: SimulationServer, **subscription: bool) -> None:
        self.socket = ClientSocket(Address.of(server.address), LIMIT)
        self.socket.send(encode(Hello(PROTOCOL, "watcher")), encode(Subscribe(**subscription)))
        self.messages: list[object] = []

    def count(self, kind: type) -> int:
        """How many messages of that kind have come until now."""
        self.messages += [decode_server(data) for data in self.socket.receive(0.05)]
        return sum(isinstance(one, kind) for one in self.messages)


def test_they_are_sent_only_to_those_who_ask(server: SimulationServer, simulation: Simulation) -> None:
    without, with_both = Watcher(server), Watcher(server, shapes=True, contacts=True)
    wait_until(lambda: with_both.count(Contacts) > 3 and without.count(Frame) > 10)
    assert without.count(Shapes) == without.count(Contacts) == 0
    assert with_both.count(Shapes) == 1  # once
    (shapes,) = (one for one in with_both.messages if isinstance(one, Shapes))
    expected = shapes_of(simulation.world.compiled)
    np.testing.assert_array_equal(shapes.fixed.size, expected.fixed.size.ravel())
    assert shapes.bodies.keys() == expected.bodies.keys()
    forces = [one for one in with_both.messages if isinstance(one, Contacts)][-1].vehicles["V1"]
    assert set(forces.parts) >= {"front_left", "rear_right"}
    mass = float(simulation.world.compiled.model.vehicles["mass"][0])
    weight = forces.force.reshape(-1, 3).sum(axis=0)
    np.testing.assert_allclose(weight, (0.0, 0.0, 9.81 * mass), atol=0.05 * 9.81 * mass)


def test_the_world_stops_to_report_forces_when_nobody_asks_any_more(
    server: SimulationServer, simulation: Simulation
) -> None:
    watcher = Watcher(server, contacts=True)
    wait_until(lambda: watcher.count(Contacts) > 0)
    watcher.socket.send(encode(Subscribe()))
    wait_until(lambda: not simulation.world.contact_forces)
    watcher.socket.send(encode(Subscribe(contacts=True)))
    wait_until(lambda: bool(simulation.world.contact_forces))
    watcher.socket.close()
    wait_until(lambda: not simulation.world.contact_forces)


def test_another_world_is_asked_too(server: SimulationServer, simulation: Simulation) -> None:
    watcher = Watcher(server, shapes=True, contacts=True)
    wait_until(lambda: watcher.count(Shapes) == 1)
    simulation.request(LoadScenario("plane")).result(LIMIT)
    wait_until(lambda: watcher.count(Scene) == 2 and watcher.count(Shapes) == 2)
    wait_until(lambda: bool(simulation.world.contact_forces))
    assert [one for one in watcher.messages if isinstance(one, Shapes)][-1].bodies.keys() == {"V1"}
