"""The command `parity`: how a real drive and the simulator differ."""

from __future__ import annotations

from pathlib import Path

import typer

from autodrive.cli.options import Force, argument, check_end, check_outputs, option


def parity(
    log: Path = argument("A log of a deployed policy (.csv).", ..., metavar="LOG"),
    vehicle: str = option("Name or file of the vehicle that describes the car.", ..., metavar="NAME"),
    policy: str = option("Name of an included policy, or a file (.npz, .onnx).", ..., metavar="NAME"),
    track: str | None = option(
        "Name or file of the map in whose frame the poses of the log are.  [default: no map: commands only]",
        metavar="NAME",
    ),
    trained_with: str = option("Name or file of the vehicle with which the policy was trained.", "roboracer"),
    output: Path | None = option(
        "HTML file to write.  [default: the log with the end .html]", None, "--output", "-o", metavar="FILE"
    ),
    force: Force = False,
) -> None:
    """Compare a drive of a deployed policy with what policy and vehicle would have done; write one HTML page."""
    from autodrive.base.cache import write_file
    from autodrive.experiments.deployment.parity import ParityLog, compare_with_simulator
    from autodrive.experiments.deployment.parity_page import page, summary

    file = output or log.with_suffix(".html")
    check_end("--output", file, ".html")
    check_outputs(file, is_forced=force)
    compared = compare_with_simulator(
        ParityLog.read(log), vehicle=vehicle, policy=policy, trained_with=trained_with, track=track
    )
    write_file(file, page(compared, f"{log.name}: the car and {vehicle}"))
    typer.echo(summary(compared))
    typer.echo(f"wrote {file}")
