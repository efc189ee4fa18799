"""Many worlds of one scenario, which one compiled call steps: for learning and parameter sweeps."""

from autodrive.world.batch.batch_world import BatchWorld as BatchWorld
from autodrive.world.readings import Readings as Readings

__all__ = ["BatchWorld", "Readings"]
