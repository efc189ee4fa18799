"""The result of an identification: values, errors before and after, a vehicle's file, and a plot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from autodrive.base.cache import write_file
from autodrive.base.svg_plot import HEIGHT, Curves, panel
from autodrive.recording.exports.comparison import PATH_HEIGHT, Comparison, paths
from autodrive.recording.plot import check_suffix, write_panels


@dataclass(frozen=True)
class Fitted:
    """A fitted parameter."""

    path: str
    """Path in the vehicle's file."""
    before: float | None
    """The value of the file; None if the file leaves it out."""
    value: float
    deviation: float
    """Standard deviation of the value, estimated from the scatter between the windows; of less than three: NaN."""
    low: float
    """Bound of the search."""
    high: float
    """Upper bound of the value."""


@dataclass(frozen=True)
class Identification:
    """Fitted parameters of a vehicle."""

    parameters: tuple[Fitted, ...]
    before: Comparison
    """The drive, or its longest part without a collision, reset or jump, and its simulation with the file's values."""
    after: Comparison
    """Comparison of the drive with the fitted values."""
    window_errors: tuple[tuple[float, float], ...]
    """Root mean square errors of path [m], speed [m/s] and yaw rate [rad/s] in the windows, before and after."""
    simulations: int
    """Number of simulations of the drive."""
    seconds: float
    """Wall time."""
    notes: tuple[str, ...]
    """What a user should know: values at their bounds, parameters that have the same effect."""
    text: str
    """The vehicle's file with the fitted values."""

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by path."""
        return {parameter.path: parameter.value for parameter in self.parameters}

    def table(self) -> str:
        """Values and errors as text."""
        width = max(9, *(len(parameter.path) for parameter in self.parameters))
        rows = [f"{'parameter':{width}}{'before':>12}{'after':>12}{'+-':>10}   bounds"]
        rows += [
            f"{parameter.path:{width}}{'none' if parameter.before is None else f'{parameter.before:.5g}':>12}"
            f"{parameter.value:12.5g}{parameter.deviation:10.2g}   {parameter.low:g} to {parameter.high:g}"
            for parameter in self.parameters
        ]
        rows += ["", f"{'error':26}{'before':>12}{'after':>12}"]
        names = ("path in a window [m]", "speed [m/s]", "yaw rate [rad/s]")
        for name, (before, after) in zip(names, self.window_errors, strict=True):
            rows.append(f"{f'{name}, rms':26}{before:12.4f}{after:12.4f}")
        before, after = self.before.errors["distance"], self.after.errors["distance"]
        rows.append(f"{'path of the drive [m], rms':26}{before[0]:12.4f}{after[0]:12.4f}")
        rows.append(f"{'  largest':26}{before[1]:12.4f}{after[1]:12.4f}")
        rows += [f"{self.simulations} simulations in {self.seconds:.1f} s", *(f"note: {note}" for note in self.notes)]
        return "\n".join(rows)

    def plot(self, path: str | Path) -> None:
        """Draw path, speed and yaw rate of the drive, before and after, as PNG or SVG. Raises `RecordingError`."""
        path = Path(path)
        check_suffix(path)
        drives = {"recorded": self.before.recorded, "before": self.before.simulated, "after": self.after.simulated}
        time = self.before.time
        panels = [paths(drives)]
        for i, (name, unit) in enumerate((("speed", "m/s"), ("yaw rate", "rad/s"))):
            curves = Curves(f"{name} [{unit}]", time, [drive[name] for drive in drives.values()], [*drives])
            panels.append(panel(curves, PATH_HEIGHT + i * HEIGHT, float(time[0]), float(time[-1])))
        write_panels(path, panels, PATH_HEIGHT + 2 * HEIGHT)

    def write(self, path: str | Path) -> None:
        """Write the vehicle's file."""
        write_file(Path(path), self.text)
