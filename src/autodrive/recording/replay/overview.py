"""Curves of a whole recording: least and greatest value of each signal in many equal parts of its time."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from autodrive.base.errors import AutodriveError
from autodrive.base.suggest import suggest
from autodrive.protocol.channels import SIGNALS, Plot, Signal
from autodrive.protocol.replay import Curve, PlotRecording

if TYPE_CHECKING:
    from autodrive.recording import Recording

PARTS = 2**15
"""Parts of the time of the recording that are kept in memory."""
SHORT = 120.0
"""A range of at most this length [s] is read from the file."""

log = logging.getLogger(__name__)

HOLD = 1.0
"""Time [s] for which a signal keeps its value at most where no sample follows."""

Columns: TypeAlias = NDArray[np.float32]
Block: TypeAlias = list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]
"""Plot, times from the start of the recording [s] and values."""
PLOTS: dict[str, tuple[Signal, Plot]] = {
    plot.id: (signal, plot) for signal in SIGNALS for plot in signal.plots if plot.reduction != "beam"
}
"""Plots by name; the range at the bearing of a viewer is not one of them."""


class Overview:
    """Curves of a recording. The first request starts a thread that reads the file once, and completes them as it goes.

    `recording` is used by this object only. The methods may be called from any thread.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._low: dict[tuple[str, str], Columns] = {}
        self._high: dict[tuple[str, str], Columns] = {}
        self._is_sampled: dict[tuple[str, str], NDArray[np.bool_]] = {}
        """Which parts have a sample, also one that is not finite."""
        self._lock = threading.Lock()
        """Held while the file is read."""
        self._thread: threading.Thread | None = None
        self._is_closing = False
        self._share = 0.0

    @property
    def share(self) -> float:
        """The share of the recording that was read, 0 to 1."""
        return self._share

    def close(self) -> None:
        """End the thread, and close the file."""
        self._is_closing = True
        if self._thread is not None:
            self._thread.join()
        self._recording.close()

    def curves(self, request: PlotRecording) -> dict[str, Curve]:
        """The curves of a request; parts that were not read yet are NaN. Raises `AutodriveError`."""
        duration = self._recording.duration
        start, end = max(request.start, 0.0), duration if request.end is None else min(request.end, duration)
        self._check(request, start, end)
        if self._thread is None:
            self._thread = threading.Thread(target=self._read_all, name="autodrive-overview", daemon=True)
            self._thread.start()
        if end - start <= min(SHORT, 0.5 * duration) or (duration <= SHORT and self.share < 1.0):
            return self._read_range(request.vehicle, request.plots, start, end, request.columns)
        first, last = (round(time / duration * PARTS) for time in (start, end))
        last = max(last, first + 1)
        edges = np.linspace(first, last, request.columns + 1).astype(int)
        curves = {}
        for plot in request.plots:
            key = request.vehicle, plot
            low, high, is_sampled = self._low.get(key), self._high.get(key), self._is_sampled.get(key)
            if low is None or high is None or is_sampled is None:
                low = high = np.full(PARTS, np.nan, np.float32)
                is_sampled = np.zeros(PARTS, np.bool_)
            columns = (_reduced(low, edges, np.fmin), _reduced(high, edges, np.fmax))
            curves[plot] = _held(*columns, _reduced(is_sampled, edges, np.maximum) > 0.0, end - start)
        return curves

    def _check(self, request: PlotRecording, start: float, end: float) -> None:
        for plot in request.plots:
            if plot not in PLOTS:
                raise AutodriveError(f"plot '{plot}' is not known. {suggest(plot, list(PLOTS))}")
        if request.vehicle not in self._recording.vehicles:
            known = suggest(request.vehicle, list(self._recording.vehicles))
            raise AutodriveError(f"vehicle '{request.vehicle}' is not known. {known}")
        if not start <= end:
            raise AutodriveError(f"a plot must begin before it ends, not from {start:g} s to {end:g} s")

    # -- reading ------------------------------------------------------------------------------------------------------

    def _read_range(self, vehicle: str, plots: list[str], start: float, end: float, columns: int) -> dict[str, Curve]:
        """Curves read from the file."""
        extremes = {plot: (np.full(columns, np.nan), np.full(columns, np.nan)) for plot in plots}
        is_sampled = {plot: np.zeros(columns, np.bool_) for plot in plots}
        length = max(end - start, 1e-9)
        blocks = self._blocks(vehicle, plots, start, end)
        while (block := self._next(blocks)) is not None:
            for plot, times, values in block:
                inside = (times >= start - 1e-9) & (times <= end + 1e-9)
                index = np.minimum((times[inside] - start) / length * columns, columns - 1).astype(int)
                _merge(*extremes[plot], *_runs(index), values[inside])
                is_sampled[plot][index] = True
        return {plot: _held(*extremes[plot], is_sampled[plot], end - start) for plot in plots}

    def _read_all(self) -> None:
        try:
            for vehicle in self._recording.vehicles:
                self._read_vehicle(vehicle)
        except Exception:
            log.exception("the curves of the recording cannot be read")
        self._share = 1.0

    def _read_vehicle(self, vehicle: str) -> None:
        duration, count = max(self._recording.duration, 1e-9), len(self._recording.vehicles)
        done, blocks = self._share, self._blocks(vehicle, list(PLOTS), 0.0, duration)
        while not self._is_closing and (block := self._next(blocks)) is not None:
            runs: dict[int, tuple[Any, Any]] = {}
            for plot, times, values in block:
                key = vehicle, plot
                if key not in self._low:
                    self._high[key] = np.full(PARTS, np.nan, np.float32)
                    self._is_sampled[key] = np.zeros(PARTS, np.bool_)
                    self._low[key] = np.full(PARTS, np.nan, np.float32)
                if id(times) not in runs:
                    runs[id(times)] = _runs(np.clip(times / duration * PARTS, 0, PARTS - 1).astype(int))
                _merge(self._low[key], self._high[key], *runs[id(times)], values)
                self._is_sampled[key][runs[id(times)][1]] = True
                self._share = done + min(float(times[-1]) / duration, 1.0) / count

    def _next(self, blocks: Iterator[Block]) -> Block | None:
        """The next part of the file; None after the last one."""
        with self._lock:
            return next(blocks, None)

    def _blocks(self, vehicle: str, plots: list[str], start: float, end: float) -> Iterator[Block]:
        recording = self._recording
        by_signal: dict[str, list[str]] = {}
        for plot in plots:
            by_signal.setdefault(f"{vehicle}/{PLOTS[plot][0].name.replace('.', '/')}", []).append(plot)
        offset = recording.start
        for signals in recording.signals.blocks(list(by_signal), start + offset, end + offset):
            shifted = {id(times): times - offset for times, _ in signals.values()}
            yield [
                (plot, shifted[id(times)], _scalar(PLOTS[plot][1], values))
                for name, (times, values) in signals.items()
                for plot in by_signal[name]
            ]


def _runs(index: NDArray[np.int_]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """The place of the first of each run of equal numbers, and the numbers; `index`: increasing numbers."""
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    return starts, index[starts]


def _merge(low: Any, high: Any, starts: NDArray[np.int_], places: NDArray[np.int_], values: Any) -> None:
    """Change the least and greatest value at the places; the values of a place begin at its start."""
    if len(starts):
        low[places] = np.fmin(low[places], np.fmin.reduceat(values, starts))
        high[places] = np.fmax(high[places], np.fmax.reduceat(values, starts))


def _held(low: Any, high: Any, is_sampled: NDArray[np.bool_], length: float) -> Curve:
    """The curve of columns over `length` [s]: one without a sample has the values of the one before, until the next."""
    places, sampled = np.arange(len(low)), np.flatnonzero(is_sampled)
    if len(sampled):
        latest = np.maximum.accumulate(np.where(is_sampled, places, sampled[0]))
        is_held = (places > sampled[0]) & (places < sampled[-1]) & ((places - latest) * length <= HOLD * len(places))
        low[is_held], high[is_held] = low[latest[is_held]], high[latest[is_held]]
    return Curve(low, high)


def _scalar(plot: Plot, values: Any) -> NDArray[np.float64]:
    """The plotted number of each value."""
    table = np.asarray(values, np.float64)
    if plot.reduction == "nearest":
        nearest = np.where(np.isfinite(table), table, np.inf).min(1, initial=math.inf)
        return np.where(np.isfinite(nearest), nearest, np.nan)
    nearest = table if table.ndim == 1 else table[:, plot.element]
    return np.where(np.isfinite(nearest), nearest, np.nan)


def _reduced(values: NDArray[Any], edges: NDArray[np.int_], least: np.ufunc) -> NDArray[np.float64]:
    """One value for each column; a column that is narrower than a part repeats it."""
    starts = np.minimum(edges[:-1], len(values) - 1)
    ends = np.maximum(edges[1:], starts + 1)
    if (np.diff(edges) > 0).all():
        return least.reduceat(values[: edges[-1]], starts).astype(np.float64)
    return np.array([least.reduce(values[a:b]) for a, b in zip(starts, ends, strict=True)], np.float64)
