"""Tracks: closed race tracks with centre line, race line and barriers, their files, and their generator."""

from autodrive.scenario.tracks.track import BarrierSpec, Track

__all__ = ["BarrierSpec", "Track"]
