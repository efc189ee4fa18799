"""Races: rules, checkpoints, and the scorer that times laps and gives penalties in each tick."""

from autodrive.racing.race import Move, Race
from autodrive.racing.rules import RaceRules, load_rules

__all__ = ["Move", "Race", "RaceRules", "load_rules"]
