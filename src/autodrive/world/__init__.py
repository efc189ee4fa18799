"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from autodrive.world.snapshot import Snapshot as Snapshot
from autodrive.world.world import World as World
