"""Shows a recording in the page: the same page, fed by a file in the place of a simulation."""

from autodrive.recording.replay.session import Replay, ReplayOptions, replay

__all__ = ["Replay", "ReplayOptions", "replay"]
