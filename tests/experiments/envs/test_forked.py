"""In processes that were forked, images work or an error names 'spawn', and a batch starts its threads anew."""

from __future__ import annotations

import multiprocessing
import subprocess
import sys
from collections.abc import Callable
from multiprocessing.connection import Connection

import gymnasium
import numpy as np
import pytest

import autodrive

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="this system has no fork"),
    pytest.mark.filterwarnings("ignore:.*multi-threaded, use of fork:DeprecationWarning"),
]

PATIENCE = 120.0
"""A process that has not answered after that wall time waits for ever [s]; one that works needs less than a second."""


def answer_of_a_fork(function: Callable[[], object]) -> str:
    """What the function returns in a forked process, or its error, as text."""

    def send(answers: Connection) -> None:
        try:
            answers.send(str(function()))
        except Exception as error:
            answers.send(str(error))

    context = multiprocessing.get_context("fork")
    answers, its_end = context.Pipe(duplex=False)
    process = context.Process(target=send, args=(its_end,))
    process.start()
    try:
        assert answers.poll(PATIENCE), "the forked process hangs"
        return str(answers.recv())
    finally:
        process.kill()
        process.join()


def test_cameras_in_a_fork_of_a_process_that_has_drawn_name_spawn(gl: str) -> None:
    drawn = autodrive.make("plane", cameras=True)
    envs = [
        gymnasium.make_vec("autodrive:NigelParking-v0", 1, observation="camera"),
        gymnasium.make_vec("autodrive:RoboRacer-v0", 1, observation="camera", tracks=1),
    ]
    cases: list[Callable[[], object]] = [
        lambda: [drawn.step() for _ in range(20)],  # more than between two images
        lambda: autodrive.make("plane", cameras=True),
        *(lambda env=env: env.reset(seed=1) for env in envs),
    ]
    for case in cases:
        error = answer_of_a_fork(case)
        assert "this process was forked from one that has used OpenGL" in error
        assert "multiprocessing.get_context('spawn')" in error
        assert "vector_kwargs={'context': 'spawn'}" in error
    assert answer_of_a_fork(drawn.close) == "None"
    for _ in range(20):
        drawn.step()
    assert drawn.frame.vehicles["V1"].cameras["front"].rgb.any()  # this process still draws
    drawn.close()


def test_images_of_asynchronous_environments_are_those_of_a_batch(gl: str) -> None:
    """In a process of its own, which has not used OpenGL before it forks."""
    program = """
import gymnasium, numpy as np
envs = [gymnasium.make_vec("autodrive:NigelNavigation-v0", 2, vectorization_mode=mode, observation="camera")
        for mode in ("async", "vector_entry_point")]
one, other = (env.reset(seed=3)[0]["image"].astype(int) for env in envs)
print((np.abs(one - other) > 2).mean() < 0.01, one.std() > 5.0)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=PATIENCE, check=False
    )
    assert done.stdout == "True True\n", done.stderr


def test_a_batch_continues_in_a_fork_with_the_same_bits() -> None:
    batch = autodrive.BatchWorld("plane", n=64, threads=2)
    commands = np.random.default_rng(1).uniform(-1.0, 1.0, (64, 1, 2))
    batch.step(commands, 20)
    theirs = answer_of_a_fork(lambda: batch.step(commands, 20).position.tobytes().hex())
    assert theirs == batch.step(commands, 20).position.tobytes().hex()
    batch.close()
