"""Runs a World at a pace: commands and requests in, Frames to sinks out. The only place with a clock."""

from autodrive.simulation.clock import Clock as Clock
from autodrive.simulation.clock import WallClock as WallClock
from autodrive.simulation.simulation import Simulation as Simulation
from autodrive.simulation.sinks import Sink as Sink
