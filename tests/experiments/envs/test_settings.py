"""Wrong settings of environments: each is named with what is right."""

from __future__ import annotations

from typing import Any

import pytest

from autodrive.base.errors import SpecError
from autodrive.experiments.envs.crossing import Crossing
from autodrive.experiments.envs.crossing_env import CrossingVectorEnv
from autodrive.experiments.envs.driving_env import DrivingEnv
from autodrive.experiments.envs.driving_vector_env import DrivingVectorEnv
from autodrive.experiments.envs.duel_env import DuelVectorEnv
from autodrive.experiments.envs.parallel_env import DrivingParallelEnv
from autodrive.experiments.envs.race_env import RaceParallelEnv, RaceVectorEnv
from autodrive.experiments.envs.roboracer_env import RoboRacerEnv

PARKING, MANY = (DrivingEnv, "parking"), (DrivingVectorEnv, 2, "parking")
RACER = (RoboRacerEnv,)
WRONG: list[tuple[tuple[Any, ...], dict[str, Any], str]] = [
    (PARKING, {"observation": "lidra"}, "observation: 'lidra' is not known. Known: state, lidar, camera. Did you mean"),
    (PARKING, {"action": "discrte"}, "action: 'discrte' is not known. Known: continuous, discrete. Did you mean"),
    (PARKING, {"frame_skip": 0}, "frame_skip: must be a whole number of ticks from 1 to 50, not 0"),
    (PARKING, {"frame_skip": 2.5}, "frame_skip: must be a whole number of ticks from 1 to 50, not 2.5"),
    (PARKING, {"render_mode": "rgb"}, "render_mode: 'rgb' is not known. Known: rgb_array, human."),
    (MANY, {"render_mode": "rgb_array"}, "render_mode 'rgb_array': a vector environment draws no images for "),
    (MANY, {"autoreset_mode": "SAMESTEP"}, "autoreset_mode: 'SAMESTEP' is not known.*Did you mean 'SameStep'"),
    (RACER, {"friction": 0.0}, "friction: must be a number from 0.01 to 10"),
    (RACER, {"latency": (0.3, 0.1)}, "latency: .* the smaller first"),
    (RACER, {"mass": (1, 2, 3)}, "mass: "),
    (RACER, {"track_radius": 0.1}, "track_radius: must be a number from 0.6 to 4"),
    (RACER, {"track_radius": (1.2, 0.8)}, "track_radius: .* the smaller first"),
    (RACER, {"track_area": (20.0, 5.0)}, r"track_area: must be two numbers from 6 to 60, .* not \(20.0, 5.0\)"),
    (RACER, {"track_area": 20.0}, "track_area: must be two numbers"),
    (RACER, {"tracks": 0}, "tracks: must be a whole number from 1 to 64, not 0"),
    (RACER, {"render_mode": "human"}, "render_mode: 'human' is not known. Known: rgb_array"),
    ((DrivingParallelEnv,), {"cars": 9}, "cars: must be a whole number from 2 to 8, not 9"),
    ((DrivingParallelEnv,), {"cars": 2.0}, "cars: must be a whole number from 2 to 8, not 2.0"),
    ((RaceParallelEnv,), {"cars": 1}, "cars: must be a whole number from 2 to 8, not 1"),
    ((RaceParallelEnv,), {"observation": "camera"}, ".*a race has no images"),
    ((RaceParallelEnv,), {"laps": 0}, "laps: must be a whole number from 1"),
    ((RaceVectorEnv, 3), {"cars": 2}, "num_envs: with 2 cars in a world it must be a multiple, not 3"),
    ((RaceVectorEnv, 9), {"cars": 9}, "cars: must be a whole number from 1 to 8, not 9"),
    ((RaceVectorEnv, 2), {"rivalry": 0.5}, "rivalry: must be a number from 0 to 10, and 0 for a single car, not 0.5"),
    ((CrossingVectorEnv, 6), {}, ".*with 4 cars in a world it must be a multiple, not 6"),
    ((CrossingVectorEnv, 4), {"variant": "other"}, "variant: 'other' is not known. .*published"),
    ((CrossingVectorEnv, 4), {"loss": 1.5}, "loss: must be a number from 0 to 1, not 1.5"),
    ((CrossingVectorEnv, 4), {"delay": -1.0, "rate": 0.0}, r"delay: .* -1.0\n.*rate: .* 0.1 to 1000, not 0"),
    ((DuelVectorEnv, 2), {"variant": "published", "action": "continuous"}, ".*the variant 'published' are discrete"),
    ((DuelVectorEnv, 2), {"variant": "published", "frame_skip": 0}, "frame_skip: .* from 1 to 50, not 0"),
    ((DuelVectorEnv, 2), {"variant": "published", "track_seed": 5}, "track: .* do not apply to a given track"),
    ((DuelVectorEnv, 2), {"noise": -1.0}, "noise: must be a number from 0 to 100"),
    ((Crossing, 5, "own", float("nan")), {}, "loss: must be a number from 0 to 1, not nan"),
]


@pytest.mark.parametrize(("made", "settings", "error"), WRONG)
def test_a_wrong_setting_is_named_with_what_is_right(
    made: tuple[Any, ...], settings: dict[str, Any], error: str
) -> None:
    kind, *arguments = made
    with pytest.raises(SpecError, match=error):
        kind(*arguments, **settings)
