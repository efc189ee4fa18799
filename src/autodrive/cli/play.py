"""The command `play`: a trained policy drives."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from autodrive.cli.options import Headless, Noise, ResultsFolder, results_folder
from autodrive.protocol.ports import DEVKIT_PORT, PORT

if TYPE_CHECKING:
    from autodrive.experiments.policies import Policy


def play(
    policy: Annotated[
        str,
        typer.Argument(help="Name of an included policy, or path of its file (.npz); or 'crossing' or 'duel'."),
    ],
    track: Annotated[
        str | None,
        typer.Argument(
            help="Name or file of the track on which it drives; after 'crossing' or 'duel' a network (.onnx).  "
            "[default: it serves as a devkit script]"
        ),
    ] = None,
    laps: Annotated[int, typer.Option(min=1, max=1000, help="Laps to drive.")] = 10,
    lockstep: Annotated[
        bool, typer.Option("--lockstep/--real-time", help="As fast as the machine can, instead of in real time.")
    ] = False,
    noise: Noise = False,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise.")] = 0,
    output: ResultsFolder = None,
    headless: Headless = False,
    port: Annotated[
        int | None,
        typer.Option(min=0, max=65535, help=f"Port of the page, by default {PORT}; of the script {DEVKIT_PORT}."),
    ] = None,
    episodes: Annotated[
        int | None,
        typer.Option(min=1, max=10000, help="Of 'crossing' or 'duel'.  [default: no limit; 100 with --headless]"),
    ] = None,
) -> None:
    """Drive with a trained policy.

    With a track the car RoboRacer drives some laps in the page; prints the laps and collisions. Without one the policy
    is a devkit script for `autodrive race --devkit`. A policy for another task drives in its environment, in the page.
    `autodrive play crossing POLICY.onnx` and `autodrive play duel POLICY.onnx` let a network made for the published
    benchmarks drive all cars.
    """
    if policy in ("crossing", "duel"):
        _foreign(policy, track, episodes, seed, headless)
        return
    from autodrive.experiments.envs.time_trial import TimeTrial
    from autodrive.experiments.policies import Policy

    chosen = Policy.find(policy)
    if chosen.task != TimeTrial.name:
        _in_environment(chosen)
    elif track is None:
        _as_script(chosen, DEVKIT_PORT if port is None else port)
    else:
        from autodrive.cli.race import show_race
        from autodrive.run.play import race
        from autodrive.run.race import RaceOptions

        options = RaceOptions(
            track,
            devkits=(),
            teams=(_team(Path(policy)),),
            rules="practice",
            laps=laps,
            has_realistic_sensors=noise,
            is_lockstep=lockstep,
            seed=seed,
            output=results_folder(output),
            has_page=not headless,
            port=port,
        )
        show_race(options, lambda stop, display: race(chosen, options, stop=stop, observer=display))


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


def _foreign(task: str, network: str | None, episodes: int | None, seed: int, headless: bool) -> None:
    """Let a network drive all cars of a published task, and print how often they succeeded."""
    from autodrive.base.errors import SpecError
    from autodrive.experiments.policies.foreign import ForeignPolicy
    from autodrive.run import foreign

    if network is None:
        raise SpecError([f"autodrive play {task} needs a network: autodrive play {task} POLICY.onnx"])
    policy = ForeignPolicy(network, task)
    if headless:
        successes = foreign.drive(policy, episodes or 100, seed)
    else:
        successes = foreign.show(policy, episodes, seed)
    count, cars = successes.shape
    share, whole = successes.mean(), successes.all(1).mean()
    number = f"{count} episode{'s' * (count > 1)}"
    typer.echo(f"{number}: {share:.1%} of the cars succeeded, all {cars} in {whole:.1%}")
