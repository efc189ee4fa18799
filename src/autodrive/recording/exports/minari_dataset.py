"""A dataset of Minari: one episode for each part of the recording between resets.

A process of its own writes it: where the disk is full, the threads of pyarrow, which Minari uses, can abort.
"""

from __future__ import annotations

import os
import pickle
import signal
import sys
import warnings
from collections import Counter
from pathlib import Path

import gymnasium
import minari
import numpy as np
from minari.data_collector import EpisodeBuffer

from autodrive.base.child_process import start_module, take_stdout
from autodrive.recording import Recording, RecordingError
from autodrive.recording.exports.learning import ACTION, STATE, DatasetStep, checked, steps
from autodrive.recording.exports.options import ExportOptions

RATE = 20.0
"""Default rate of the steps [Hz]."""


def write(recording: Recording, path: Path, options: ExportOptions, _: str) -> None:
    """Write a folder that holds the dataset `autodrive/NAME-v0`; rewards are 0, since a recording has none.

    Load it with `MINARI_DATASETS_PATH=FOLDER` and `minari.load_dataset("autodrive/NAME-v0")`. Images are left out.
    """
    rate = options.rate or RATE
    all_steps = checked(list(steps(recording, options, rate)))
    episodes = [episode for episode, count in Counter(step.episode for step in all_steps).items() if count > 1]
    buffers = [_episode(i, [step for step in all_steps if step.episode == number]) for i, number in enumerate(episodes)]
    name = "".join(letter if letter.isalnum() else "-" for letter in path.stem).strip("-") or "drive"
    description = (
        f"AutoDRIVE recording of '{recording.scenario.name}'. {rate:g} steps in a second. "
        f"State: {', '.join(STATE)}. Action: {', '.join(ACTION)}."
    )
    path.mkdir(parents=True)
    with start_module("autodrive.recording.exports.minari_dataset") as process:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump((path.absolute(), f"autodrive/{name}-v0", description, buffers), process.stdin)
            process.stdin.flush()
            error = pickle.load(process.stdout)
        except (EOFError, BrokenPipeError, pickle.UnpicklingError):
            status = process.wait()
            end = signal.Signals(-status).name if status < 0 else f"exit code {status}"
            error = RecordingError(f"cannot write: the process of Minari ended with {end}; is the disk full?  ({path})")
        except BaseException:
            process.kill()
            raise
    if error is not None:
        raise error


def main() -> None:
    """Write the dataset that comes from stdin; the answer is the error, or None."""
    answers = take_stdout()
    error: BaseException | None = None
    try:
        _create(*pickle.load(sys.stdin.buffer))
    except Exception as raised:  # the other process raises it
        error = raised
    pickle.dump(error, answers)
    answers.flush()


def _create(folder: Path, name: str, description: str, buffers: list[EpisodeBuffer]) -> None:
    os.environ["MINARI_DATASETS_PATH"] = str(folder)  # Minari joins a relative one twice
    warnings.simplefilter("ignore")  # about an author, and other things that a recording does not have
    minari.create_dataset_from_buffers(
        name,
        buffer=buffers,
        observation_space=gymnasium.spaces.Box(-np.inf, np.inf, (len(STATE),), np.float32),
        action_space=gymnasium.spaces.Box(-1.0, 1.0, (len(ACTION),), np.float32),
        algorithm_name="recording",
        description=description,
        data_format="arrow",
    )


def _episode(number: int, episode_steps: list[DatasetStep]) -> EpisodeBuffer:
    """N + 1 observations, n actions; the action of a step was given at its observation."""
    count = len(episode_steps) - 1
    return EpisodeBuffer(
        id=number,
        observations=[step.state for step in episode_steps],
        actions=[step.action for step in episode_steps[:-1]],
        rewards=[0.0] * count,
        terminations=[False] * count,
        truncations=[False] * (count - 1) + [True],
        infos={},
    )
