"""Curves of a recording contain the extremes of all values, in each column."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from autodrive import recording
from autodrive.base.errors import AutodriveError
from autodrive.protocol.replay import PlotRecording
from autodrive.recording.replay.overview import Overview
from tests.recording.conftest import Drive
from tests.support.waiting import wait_until


@pytest.fixture
def overview(drive: Drive) -> Iterator[Overview]:
    opened = Overview(recording.open(drive.path))
    yield opened
    opened.close()


@pytest.mark.parametrize(("start", "end"), [(0.0, None), (0.3, 0.9)], ids=["all", "part"])
def test_each_column_has_the_least_and_the_greatest_value(
    overview: Overview, drive: Drive, start: float, end: float | None
) -> None:
    names = {"speed": ("velocity", 0), "throttle": ("throttle", None), "yaw": ("imu.euler", 2)}
    request = PlotRecording("V1", [*names], start, end, columns=17)
    overview.curves(request)
    wait_until(lambda: overview.share == 1.0)
    curves = overview.curves(request)
    with recording.open(drive.path) as opened:
        moments = [(time - opened.start, frame) for time, frame in opened.moments()]
        last = opened.duration if end is None else end
    # the columns of the whole recording begin at one of 2^15 parts of its time
    slack = last / 2**15
    for plot, (path, element) in names.items():
        for column in range(17):
            begin, until = (start + (last - start) * (column + i) / 17 for i in (0, 1))
            values = []
            for time, frame in moments:
                if begin + slack <= time < until - slack:
                    value = frame.vehicles["V1"]
                    for name in path.split("."):
                        value = getattr(value, name)
                    values.append(float(value if element is None else value[element]))  # type: ignore[arg-type,index]
            # float32
            assert curves[plot].low[column] <= min(values) + 1e-6
            assert curves[plot].high[column] >= max(values) - 1e-6
        whole = [np.nanmin(curves[plot].low), np.nanmax(curves[plot].high)]
        assert np.isfinite(whole).all()


@pytest.mark.parametrize("end", [None, 0.9], ids=["all", "part"])
@pytest.mark.parametrize("plot", ["speed", "nearest"])
def test_a_curve_of_many_columns_keeps_each_value_until_the_next(
    overview: Overview, drive: Drive, plot: str, end: float | None
) -> None:
    request = PlotRecording("V1", [plot], 0.0, end, columns=2000)
    overview.curves(request)
    wait_until(lambda: overview.share == 1.0)
    curve = overview.curves(request)[plot]
    with recording.open(drive.path) as opened:
        frames = [frame.vehicles["V1"] for _, frame in opened.moments()]
    known = {float(vehicle.velocity[0]) for vehicle in frames}
    if plot == "nearest":
        known = {
            min(range_ for range_ in vehicle.lidar.ranges if np.isfinite(range_)) for vehicle in frames if vehicle.lidar
        }
    first, last = np.flatnonzero(np.isfinite(curve.low))[[0, -1]]
    assert np.isfinite(curve.low[first:last]).all()
    for values in (curve.low, curve.high):
        nearest = np.abs(values[first:last, None] - np.array(sorted(known))).min(1)
        assert nearest.max() < 1e-6
    assert last - first > 1500  # the last scan comes at most 1/7 s before the end


def test_what_does_not_exist_is_named(overview: Overview) -> None:
    with pytest.raises(AutodriveError, match=r"plot 'spede' is not known.*Did you mean 'speed'"):
        overview.curves(PlotRecording("V1", ["spede"]))
    with pytest.raises(AutodriveError, match="vehicle 'V9' is not known"):
        overview.curves(PlotRecording("V9", ["speed"]))
    with pytest.raises(AutodriveError, match="begin before it ends"):
        overview.curves(PlotRecording("V1", ["speed"], 2.0, 1.0))
