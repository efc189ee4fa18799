"""Runs a World at a pace: commands and requests in, Frames to sinks out. The only place with a clock."""

from autodrive.world.simulation.clock import Clock as Clock
from autodrive.world.simulation.clock import WallClock as WallClock
from autodrive.world.simulation.control import Sink as Sink
from autodrive.world.simulation.simulation import Simulation as Simulation
