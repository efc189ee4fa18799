"""Terminal output of the command `run`: compile progress, link to the page, status line, summary."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import typer

from autodrive.run.browser import has_screen, open_page, tunnel
from autodrive.run.runner import Run, RunObserver

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from autodrive.run.summary import CamerasSummary, Summary
    from autodrive.world.racing.results import RaceResult

CALLS_PER_LOG_LINE = 50
"""Without a terminal, the status is printed at every 50th call only: every ten seconds."""
COMPILED_FUNCTIONS = 90
"""Approximate number of functions that the first start compiles; length of the progress bar."""


class StatusDisplay(RunObserver):
    """A status line, live on a terminal, otherwise printed every ten seconds; calls `on_start` before time starts."""

    def __init__(
        self,
        console: Console,
        line: Status,
        title: str,
        *,
        opens_browser: bool,
        on_start: Callable[[Run], None],
        on_result: Callable[[RaceResult], None] = lambda _: None,
    ) -> None:
        self._console = console
        self._line = line
        self._title = title
        self._opens_browser = opens_browser
        self._on_start = on_start
        self._on_result = on_result
        self._compiled = 0
        self._calls = 0

    def compiled(self, function: str) -> None:  # noqa: D102
        if not self._compiled:
            self._console.print("compiling the physics for this machine: 20 to 70 s, only at the first start")
        self._compiled += 1
        share = min(1.0, self._compiled / COMPILED_FUNCTIONS)
        bar = "█" * round(30 * share) + "░" * (30 - round(30 * share))
        self._line.update(f"{bar} {self._compiled}/{COMPILED_FUNCTIONS} {function}")

    def started(self, run: Run) -> None:  # noqa: D102
        self._on_start(run)
        if self._compiled:
            self._console.print(f"compiled {self._compiled} functions")
        self._console.print(f"{self._title}; press Ctrl-C to stop")
        if run.link:
            self._print_link(run.link)

    def _print_link(self, link: str) -> None:
        is_opened = self._opens_browser and self._console.is_terminal and has_screen() and open_page(link)
        self._console.print(f"{'opened' if is_opened else 'open'} in a browser:  {link}", soft_wrap=True)
        if command := tunnel(link):
            self._console.print(f"first, on your own machine, run:  {command}", soft_wrap=True)

    def decided(self, result: RaceResult) -> None:  # noqa: D102
        self._on_result(result)

    def running(self, run: Run) -> None:  # noqa: D102
        self._calls += 1
        if self._console.is_terminal:
            self._line.update(run.status())
        elif self._calls % CALLS_PER_LOG_LINE == 0:
            self._console.print(run.status(), soft_wrap=True)


def print_summary(summary: Summary) -> None:
    """Print the summary in a few lines to stdout."""
    typer.echo(
        f"{summary.simulated_time:.2f} s simulated in {summary.wall_time:.2f} s (x{summary.real_time_factor:.2f}), "
        f"{summary.ticks} ticks, {summary.late_ticks} late; ended by {summary.ended_by}"
    )
    for name, vehicle in summary.vehicles.items():
        x, y, _ = vehicle.pose.position
        typer.echo(
            f"{name}: {vehicle.distance:.2f} m driven, {vehicle.collisions} collisions, "
            f"at ({x:.3f}, {y:.3f}) m, heading {math.degrees(vehicle.pose.yaw):.1f} degrees"
        )
    if summary.cameras:
        typer.echo(_cameras_line(summary.cameras))
    if recording := summary.recording:
        dropped = recording.dropped_frames, recording.dropped_images
        lost = f"; {dropped[0]} Frames and {dropped[1]} images were left out" if any(dropped) else ""
        typer.echo(
            f"recorded in {', '.join(recording.files) or 'no file'}{lost}" if not recording.error else recording.error
        )
    if bridge := summary.bridge:
        typer.echo(
            f"devkit at {bridge.address}: {bridge.telemetry_sent} telemetry messages, "
            f"{bridge.commands_received} commands"
            + (f", round trip {1e3 * bridge.round_trip:.1f} ms (median)" if bridge.round_trip is not None else "")
        )


def _cameras_line(cameras: CamerasSummary) -> str:
    """Image counts in one line; the reason for missing images was already logged."""
    if cameras.error:
        return "cameras: unavailable"
    counts = [
        f"{vehicle} {camera} {of_camera.count} images ({of_camera.rate:.1f} Hz)"
        for vehicle, by_camera in cameras.images.items()
        for camera, of_camera in by_camera.items()
    ]
    median = "" if cameras.draw_time is None else f", {1e3 * cameras.draw_time:.1f} ms (median)"
    return f"cameras: {', '.join(counts) or 'no images'}; rendered by {cameras.renderer}{median}"
