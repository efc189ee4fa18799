"""Races: rules, checkpoints, and the scorer that times laps and gives penalties in each tick."""

from autodrive.scenario.race_rules import RaceRules, load_rules
from autodrive.world.racing.race import Move, Race

__all__ = ["Move", "Race", "RaceRules", "load_rules"]
