"""Terminal output of the command `run`: compile progress, link to the page, status line, summary."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import typer
from rich.console import Console
from rich.text import Text

from autodrive.base.jit import DURATION
from autodrive.cli.narrated import SILENCE
from autodrive.protocol.ports import PORT
from autodrive.run.browser import has_screen, open_page, tunnel
from autodrive.run.runner import COMPILED_FUNCTIONS, Run, RunObserver

if TYPE_CHECKING:
    from autodrive.run.summary import CamerasSummary, Summary
    from autodrive.world.racing.results import RaceResult

CALLS_PER_LOG_LINE = 50
"""Number of calls after which the status is printed without a terminal: every ten seconds."""


class StatusDisplay(RunObserver):
    """A status line, live on a terminal, otherwise printed from time to time; calls `on_start` before time starts.

    Use it as a context manager. `loading`: what goes on until the start; `title`: what is running.
    """

    def __init__(
        self,
        loading: str,
        title: str,
        *,
        opens_browser: bool = True,
        on_start: Callable[[Run], None] = lambda _: None,
        on_result: Callable[[RaceResult], None] = lambda _: None,
        console: Console | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.console = console or Console(stderr=True, highlight=False)
        self._line = self.console.status(loading)
        self._loading = loading
        self._title = title
        self._opens_browser = opens_browser
        self._on_start = on_start
        self._on_result = on_result
        self._clock = clock
        self._began = self._said = clock()
        self._is_loaded = threading.Event()
        self._compiled = 0
        self._calls = 0

    def __enter__(self) -> StatusDisplay:
        self._line.start()
        threading.Thread(target=self._narrate, name="autodrive-loading", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_loaded.set()
        self._line.stop()

    def _narrate(self) -> None:
        while not self._is_loaded.wait(0.25):
            self.narrate()

    def narrate(self) -> None:
        """Say how far the start is."""
        now = self._clock()
        count = f"{self._compiled} of about {max(COMPILED_FUNCTIONS, self._compiled)} functions"
        text = f"{f'compiling {count}' if self._compiled else self._loading}, {now - self._began:.0f} s"
        if self.console.is_terminal:
            filled = round(30 * min(1.0, self._compiled / COMPILED_FUNCTIONS))
            self._line.update(f"{'█' * filled}{'░' * (30 - filled)} {text}" if self._compiled else text)
        elif now - self._said >= SILENCE:
            self._said = now
            self.console.print(text)

    def compiled(self, function: str) -> None:  # noqa: D102
        if not self._compiled:
            self.console.print(f"compiling the physics for this machine, only at the first start: {DURATION}")
            self._said = self._clock()
        self._compiled += 1

    def serving(self, link: str) -> None:  # noqa: D102
        self._print_link(link)

    def started(self, run: Run) -> None:  # noqa: D102
        self._is_loaded.set()
        self._on_start(run)
        if self._compiled:
            self.console.print(f"compiled {self._compiled} functions in {self._clock() - self._began:.0f} s")
        if not run.link:
            self._print("without the page (--headless): clients and the direct ROS bridge cannot connect")
        self._print(f"{self._title}; press Ctrl-C to stop")

    def _print_link(self, link: str) -> None:
        is_opened = self._opens_browser and self.console.is_terminal and has_screen() and open_page(link)
        self._print(f"{'opened' if is_opened else 'open'} in a browser:  {link}")
        if command := tunnel(link):
            self._print(f"first, on your own machine, run:  {command}")
        if note := _note_for_clients(link):
            self._print(note)

    def _print(self, text: str) -> None:
        """Print a text as it is: the brackets of an IPv6 address are no markup."""
        self.console.print(text, soft_wrap=True, markup=False)

    def decided(self, result: RaceResult) -> None:  # noqa: D102
        self._on_result(result)

    def running(self, run: Run) -> None:  # noqa: D102
        self._calls += 1
        if self.console.is_terminal:
            self._line.update(Text(run.status()))
        elif self._calls % CALLS_PER_LOG_LINE == 0:
            self._print(run.status())


def _note_for_clients(link: str) -> str:
    """The address that clients need; empty if it is the default one."""
    parts = urlsplit(link)
    if (parts.port, parts.query) == (PORT, "") and parts.hostname == "127.0.0.1":
        return ""
    address = link if parts.query else parts.netloc
    note = "clients that start in this folder need no address"
    return f"clients need this address:  autodrive.Client({address!r})  ({note})"


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
