"""A dataset of Minari: one episode for each part of the recording between resets."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from pathlib import Path

import gymnasium
import minari
import numpy as np
from minari.data_collector import EpisodeBuffer

from autodrive.recording import Recording
from autodrive.recording.exports.learning import ACTION, STATE, Step, checked, steps
from autodrive.recording.exports.options import ExportOptions

RATE = 20.0
"""Default rate of the steps [Hz]."""


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write a folder that holds the dataset `autodrive/NAME-v0`; rewards are 0, since a recording has none.

    Load it with `MINARI_DATASETS_PATH=FOLDER` and `minari.load_dataset("autodrive/NAME-v0")`. Images are left out.
    """
    rate = options.rate or RATE
    found = checked(list(steps(recording, options, rate)))
    episodes = [episode for episode, count in Counter(one.episode for one in found).items() if count > 1]
    buffers = [_episode(i, [one for one in found if one.episode == number]) for i, number in enumerate(episodes)]
    name = "".join(letter if letter.isalnum() else "-" for letter in path.stem).strip("-") or "drive"
    before = os.environ.get("MINARI_DATASETS_PATH")
    os.environ["MINARI_DATASETS_PATH"] = str(path.absolute())  # Minari joins a relative one twice
    path.mkdir(parents=True)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about an author, and other things that a recording does not have
            minari.create_dataset_from_buffers(
                f"autodrive/{name}-v0",
                buffer=buffers,
                observation_space=gymnasium.spaces.Box(-np.inf, np.inf, (len(STATE),), np.float32),
                action_space=gymnasium.spaces.Box(-1.0, 1.0, (len(ACTION),), np.float32),
                algorithm_name="recording",
                description=f"AutoDRIVE recording of '{recording.scenario.name}'. {rate:g} steps in a second. "
                f"State: {', '.join(STATE)}. Action: {', '.join(ACTION)}.",
                data_format="arrow",
            )
    finally:
        if before is None:
            del os.environ["MINARI_DATASETS_PATH"]
        else:
            os.environ["MINARI_DATASETS_PATH"] = before


def _episode(number: int, found: list[Step]) -> EpisodeBuffer:
    """N + 1 observations, n actions; the action of a step was given at its observation."""
    count = len(found) - 1
    return EpisodeBuffer(
        id=number,
        observations=[one.state for one in found],
        actions=[one.action for one in found[:-1]],
        rewards=[0.0] * count,
        terminations=[False] * count,
        truncations=[False] * (count - 1) + [True],
        infos={},
    )
