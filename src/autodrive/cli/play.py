"""The command `play`: a trained policy drives."""

from __future__ import annotations

from collections.abc import Mapping, Set
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from autodrive.cli.options import Force, Headless, Noise, ResultsFolder, argument, filled, option, results_folder
from autodrive.protocol.ports import DEVKIT_PORT, PORT

if TYPE_CHECKING:
    from autodrive.experiments.policies import Policy
    from autodrive.experiments.policies.team import Team

TEAMS = {"crossing": "crossing", "duel": "head_to_head"}
"""Tasks of several cars, and the included policy of each."""


def play(
    policy: str = argument("Name of an included policy, or path of its file (.npz); or 'crossing' or 'duel'.", ...),
    track: str | None = argument(
        "Name or file of the track on which the policy drives; after 'crossing' or 'duel' a policy (.npz, .onnx).  "
        "[default: the policy serves as a devkit script]"
    ),
    laps: int | None = option("Laps to drive.  [default: 10; of 'duel' 2]", min=1, max=1000),
    lockstep: bool = option(
        "Drive as fast as the machine can, instead of in real time.", False, "--lockstep/--real-time"
    ),
    noise: Noise = False,
    seed: int = option("Seed of the noise.", 0, min=0),
    output: ResultsFolder = None,
    headless: Headless = False,
    port: int | None = option(f"Port of the page, by default {PORT}; of the script {DEVKIT_PORT}.", min=0, max=65535),
    episodes: int | None = option(
        "Number of episodes of 'crossing' or 'duel'.  [default: no limit; 100 with --headless]", min=1, max=10000
    ),
    rival: str | None = option(
        "What drives the second car of 'duel': a policy, or a Python file with command(ranges, angles), such as "
        "examples/racing/follow_the_gap.py; if a network (.onnx) drives the first one, another network.  "
        "[default: the same policy]",
        metavar="NAME",
    ),
    force: Force = False,
) -> None:
    """Drive with a trained policy.

    With a track the car RoboRacer drives some laps in the page; prints the laps and collisions. Without one the policy
    is a devkit script for `autodrive race --devkit`. A policy for another task drives in its environment, in the page.
    `autodrive play crossing` lets four cars drive through a crossing, `autodrive play duel` two cars race; a policy may
    follow: one that was trained here (.npz), or a network made for the published benchmarks (.onnx).
    """
    arguments = locals()
    from autodrive.experiments.envs.crossing import Crossing
    from autodrive.experiments.envs.time_trial import TimeTrial
    from autodrive.experiments.policies import Policy

    is_given = {
        "a track" if name == "track" else f"--{name}": value is not None and value is not False
        for name, value in arguments.items()
        if name not in ("policy", "seed")
    }
    is_team = policy in TEAMS
    chosen = None if is_team else Policy.find(policy)
    if is_team or (chosen is not None and chosen.task == Crossing.name):
        task = policy if is_team else Crossing.name
        without = {"--output", "--force", *(() if is_team else ("a track",)), *(("--port",) if headless else ())}
        if task == "crossing":
            without |= {"--laps", "--noise", "--rival"}
        elif track is not None and Path(track).suffix != ".npz":  # a network of the published task
            without |= {"--laps"}
        _refuse(is_given, without, f"in the task '{task}'{' without the page' * headless}")
        team = _team_of(task, track if is_team else policy, rival, laps=laps or 2, has_noise=noise)
        _drive_team(team, episodes, seed, headless=headless, port=port, is_lockstep=lockstep)
        return
    assert chosen is not None
    if chosen.task != TimeTrial.name:
        _refuse(is_given, set(is_given), f"in the environment of the task '{chosen.task}'")
        _in_environment(chosen)
    elif track is None:
        _refuse(is_given, is_given.keys() - {"--port"}, "for a policy without a track, which is a devkit script")
        _as_script(chosen, DEVKIT_PORT if port is None else port)
    else:
        from autodrive.cli.race import show_race
        from autodrive.connect.server.served import PageOptions
        from autodrive.run.play import race
        from autodrive.run.race import RaceOptions

        _refuse(is_given, {"--episodes", "--rival"}, "on a track")
        options = filled(
            RaceOptions,
            arguments,
            teams=(_team(Path(policy)),),
            rules="practice",
            laps=laps or 10,
            has_realistic_sensors=noise,
            is_lockstep=lockstep,
            output=results_folder(output),
            has_page=not headless,
            page=PageOptions(port=port),
        )
        show_race(options, force, lambda stop, display: race(chosen, options, stop=stop, observer=display))


def _refuse(options: Mapping[str, bool], names: Set[str], where: str) -> None:
    """Raises `SpecError` if one of these options is given: it would mean nothing."""
    from autodrive.base.errors import SpecError

    if errors := [f"{name} has no meaning {where}" for name, is_given in options.items() if is_given and name in names]:
        raise SpecError(errors)


def _team(policy: Path) -> str:
    """Name in the standings: that of the file; of `policy.npz`, which each training writes, that of its folder."""
    return policy.absolute().parent.name if policy.stem == "policy" else policy.stem


def _as_script(policy: Policy, port: int) -> None:
    """Serve as a devkit script until Ctrl-C."""
    from autodrive.run.play import script

    with script(policy, port) as server:
        typer.echo(f"start the race with: --devkit 127.0.0.1:{server.port}  (Ctrl-C to stop)")
        server.wait()


def _in_environment(policy: Policy) -> None:
    """Drive in the environment of its task until Ctrl-C."""
    from autodrive.run.play import play_environment

    play_environment(policy)


def _team_of(task: str, policy: str | None, rival: str | None, *, laps: int, has_noise: bool) -> Team:
    """All cars of a task, and the policy that drives them; None: the included one."""
    from autodrive.base.errors import SpecError
    from autodrive.experiments.policies import Policy
    from autodrive.experiments.policies.foreign import ForeignPolicy
    from autodrive.experiments.policies.team import duel_team, foreign_team, learnt_team, program

    is_network = policy is not None and Path(policy).suffix == ".onnx"
    if rival is not None and is_network != (Path(rival).suffix == ".onnx"):
        raise SpecError(["--rival: a network (.onnx) drives in the published task, against another network only"])
    if is_network:
        assert policy is not None
        other = None if rival is None else ForeignPolicy(rival, task)
        return foreign_team(ForeignPolicy(policy, task), other, has_noise=has_noise)
    chosen = Policy.find(policy or TEAMS[task])
    if task == "crossing":
        return learnt_team(chosen)
    if rival is None:
        other = chosen
    else:
        other = program(Path(rival)) if Path(rival).suffix == ".py" else Policy.find(rival)
    return duel_team(chosen, other, laps=laps, has_noise=has_noise)


def _drive_team(
    team: Team, episodes: int | None, seed: int, *, headless: bool, port: int | None, is_lockstep: bool
) -> None:
    """Drive all cars of a task, and print how often they succeeded."""
    from autodrive.experiments.policies.team import drive, show, summary

    if headless:
        results = drive(team, episodes or 100, seed)
    else:
        results = show(team, episodes, seed, port=port, is_real_time=not is_lockstep)
    typer.echo(summary(team, results))
