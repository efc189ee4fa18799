"""The world: `World.step(commands)` moves the State by one tick and returns a Frame."""

from autodrive.physics.sensors.own import OwnSensor as OwnSensor
from autodrive.physics.sensors.own import SensorView as SensorView
from autodrive.world.snapshot import Snapshot as Snapshot
from autodrive.world.world import World as World
