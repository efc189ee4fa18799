"""The table of a campaign: Parquet files that grow while runs end, and one sorted file at the end."""

from __future__ import annotations

import contextlib
import json
import math
import shutil
import sqlite3
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from autodrive.base.cache import make_folder, new_file
from autodrive.base.errors import AutodriveError
from autodrive.base.installation import missing
from autodrive.base.texts import encodable
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.runner import RunResult

if TYPE_CHECKING:
    import numpy as np
    import pyarrow
    from numpy.typing import NDArray

    from autodrive.base.arrays import Floats

PART_TIME, PART_ROWS = 5.0, 5000
"""A part is written after that time [s], or with so many rows."""
BLOCK, ROW_GROUP = 2**16, 2**20
"""Runs whose rows are in memory at a time: as dictionaries, and as columns."""
FIRST = ("run", "sample", "seed", "status", "margin", "end", "time", "digest", "error", "recording", "key")
"""Columns before those of metrics and parameters."""


class Table:
    """Rows of a campaign in a folder: `parts/*.parquet` while it runs, `table.parquet` when it has ended.

    Memory does not grow with the number of rows.
    """

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        """Raises `AutodriveError` if pyarrow is not installed, or cannot open files in the folder."""
        self._parquet = _parquet()
        if (name := encodable(str(folder))) != str(folder):
            raise AutodriveError(f"the name '{name}' is not UTF-8: choose another folder for the results (--output)")
        self._campaign = campaign
        self.path = folder / "table.parquet"
        self._parts, self._earlier = folder / "parts", folder / "earlier"
        self._schema = schema(campaign)
        self._rows: list[dict[str, Any]] = []
        self._written = time.monotonic()
        self._count = 0

    def run(self, number: int) -> CampaignRun | None:
        """The run of that number, with the parameters in the table; None if it is not there."""
        kinds, types = _kinds(self._campaign), self._campaign.spec.parameters
        row = self._stored().get(number)
        if row is None or not row.keys() >= kinds.keys():
            return None
        values = {path: row[path] for path in kinds}
        for path, kind in kinds.items():
            if kind is str and not all(isinstance(value, str) for value in types[path].values):
                values[path] = json.loads(row[path])
        return CampaignRun(number, row["sample"], row["seed"], values)

    def key(self, number: int) -> str:
        """The key of the run of that number; empty if it is not there."""
        return (self._stored().get(number) or {}).get("key", "")

    def start(self) -> Stored:
        """Begin with an empty table. Returns the rows of earlier, also broken, campaigns in this folder.

        Those that still hold are to be added again. Raises `AutodriveError` if a file is not a table of a campaign.
        """
        self._stored()
        make_folder(self._earlier)
        for number, path in enumerate(_files(self._parts), len(_files(self._earlier))):
            path.replace(self._earlier / f"{number:06d}.parquet")
        make_folder(self._parts)
        return self._stored()

    def add(self, run: CampaignRun, key: str, result: RunResult) -> dict[str, Any]:
        """Add a row; returns it."""
        row = row_of(self._campaign, run, key, result)
        self._rows.append(row)
        return row

    @property
    def is_due(self) -> bool:
        """Whether a part is to be written."""
        return len(self._rows) >= PART_ROWS or (bool(self._rows) and time.monotonic() - self._written > PART_TIME)

    def write_part(self) -> None:
        """Write the rows that are not written yet."""
        if self._rows:
            import pyarrow as pa  # noqa: PLC0415  an extra

            self._count += 1
            with new_file(self._parts / f"{self._count:06d}.parquet") as file:
                self._parquet.write_table(pa.Table.from_pylist(self._rows, schema=self._schema), file)
        self._rows, self._written = [], time.monotonic()

    def finish(self) -> Columns:
        """Write the sorted table; the same rows give the same bytes."""
        self.write_part()
        parts = Stored(_files(self._parts))
        with new_file(self.path) as file, self._parquet.ParquetWriter(file, self._schema) as writer:
            for first in range(0, parts.end, ROW_GROUP):
                if rows := parts.between(first, first + ROW_GROUP):
                    writer.write_table(rows.sort_by("run"), ROW_GROUP)
        shutil.rmtree(self._parts, ignore_errors=True)
        shutil.rmtree(self._earlier, ignore_errors=True)
        return Columns(self.path)

    def _stored(self) -> Stored:
        """All rows in the folder; of a run that is there twice, the later row counts."""
        table = [self.path] if self.path.is_file() else []
        return Stored([*table, *_files(self._earlier), *_files(self._parts)])


class Stored:
    """Rows in Parquet files, of which only those of some neighbouring runs are in memory."""

    def __init__(self, paths: list[Path]) -> None:
        """Raises `AutodriveError` if a file is not a table of a campaign."""
        self._parquet = _parquet()
        self._files = [(path, *self._range(path)) for path in paths]
        self.end = max((end for _, _, end in self._files), default=0)
        """One more than the greatest number of a run."""
        self._block = -1
        self._rows: dict[int, dict[str, Any]] = {}

    def get(self, number: int) -> dict[str, Any] | None:
        """The row of a run; fast if runs are asked for in their order."""
        if self._block != number // BLOCK:
            self._block = number // BLOCK
            first = self._block * BLOCK
            self._rows = {row["run"]: row for part in self._tables(first, first + BLOCK) for row in part.to_pylist()}
        return self._rows.get(number)

    def between(self, first: int, end: int) -> pyarrow.Table | None:
        """The rows of the runs from `first` to before `end`, if there are any, of files with the same columns."""
        import pyarrow as pa  # noqa: PLC0415  an extra

        tables = [part for part in self._tables(first, end) if len(part)]
        return pa.concat_tables(tables).combine_chunks() if tables else None

    def _tables(self, first: int, end: int) -> list[pyarrow.Table]:
        filters = [("run", ">=", first), ("run", "<", end)]
        return [
            self._parquet.read_table(path, filters=filters)
            for path, low, high in self._files
            if low < end and first < high
        ]

    def _range(self, path: Path) -> tuple[int, int]:
        """The least number of a run in a file, and one more than the greatest one."""
        try:
            with self._parquet.ParquetFile(path) as file:
                columns = file.schema_arrow.names
                groups = [file.metadata.row_group(i) for i in range(file.metadata.num_row_groups)]
                ranges = [row_group.column(columns.index("run")).statistics for row_group in groups]
                columns.index("key")
                return min((statistics.min for statistics in ranges), default=0), max(
                    (statistics.max + 1 for statistics in ranges), default=0
                )
        except (ValueError, TypeError, AttributeError):  # pyarrow's errors of wrong files, and other columns
            raise AutodriveError(
                f"{path} is not a table of a campaign; delete it, or choose another folder (--output)"
            ) from None


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """No other campaign writes into the folder meanwhile. Raises `AutodriveError` if one does.

    The lock is one of SQLite, which the system removes when the process ends, however it ends.
    """
    with contextlib.ExitStack() as stack:
        try:
            file = sqlite3.connect(folder / ".lock", timeout=0.0, isolation_level=None)
            stack.enter_context(contextlib.closing(file)).execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:  # others: a file system without locks, or one that is read-only
            if error.sqlite_errorcode == sqlite3.SQLITE_BUSY:
                raise AutodriveError(
                    f"another campaign is writing into '{folder}': wait until it has ended, or choose another folder "
                    "with --output"
                ) from None
        yield


class Columns:
    """The columns of a table; each is read when it is asked for, so that never all of them are in memory."""

    def __init__(self, path: Path) -> None:
        from pyarrow import compute  # noqa: PLC0415  an extra

        self._path, self._parquet, self._compute = path, _parquet(), cast(Any, compute)

    def __len__(self) -> int:
        return self._parquet.read_metadata(self._path).num_rows

    def __getitem__(self, name: str) -> pyarrow.ChunkedArray:
        with self._parquet.ParquetFile(self._path) as file:
            return file.read(columns=[name]).column(name)

    def numbers(self, name: str) -> Floats:
        """A column of numbers; nan where there is none."""
        return self[name].cast("float64").to_numpy()

    def where(self, name: str, value: Any) -> NDArray[np.bool_]:
        """The places of a column that have this value, as truth values."""
        return self._compute.equal(self[name], value).to_numpy()

    def varies(self, name: str) -> bool:
        """Whether a column has more than one value."""
        least, greatest = self._compute.min_max(self[name]).as_py().values()
        return least != greatest

    def rows(self, runs: list[int]) -> list[dict[str, Any]]:
        """The rows of these runs, in this order."""
        rows = self._parquet.read_table(self._path, filters=[("run", "in", runs)]).to_pylist() if runs else []
        return sorted(rows, key=lambda row: runs.index(row["run"]))


def row_of(campaign: Campaign, run: CampaignRun, key: str, result: RunResult) -> dict[str, Any]:
    """The row of a run."""
    criterion = campaign.criterion
    margin = None if criterion is None or result.error else criterion.margin(result.metrics)
    if result.error:
        status = "error"
    elif criterion is None:
        status = "done"
    else:
        status = "pass" if criterion.holds(result.metrics) else "fail"
    metrics = {name: result.metrics.get(name, math.nan) for name in campaign.metric_names}
    return {
        "run": run.number,
        "sample": run.sample,
        "seed": run.seed,
        "status": status,
        "margin": margin,
        "end": result.end,
        "time": result.time,
        "digest": result.digest,
        "error": result.error,
        "recording": Path(result.recording).name if result.recording else "",
        "key": key,
        **{name: None if math.isnan(value) else value for name, value in metrics.items()},
        **{path: _as(kind, run.values[path]) for path, kind in _kinds(campaign).items()},
    }


def schema(campaign: Campaign) -> pyarrow.Schema:
    """Names and types of the columns."""
    import pyarrow as pa  # noqa: PLC0415  an extra

    types: dict[str, Any] = dict.fromkeys(("run", "sample", "seed", "digest"), pa.int64())
    types |= dict.fromkeys(("margin", "time"), pa.float64())
    arrow_type = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
    fields = [(name, types.get(name, pa.string())) for name in FIRST]
    fields += [(name, pa.float64()) for name in campaign.metric_names]
    fields += [(path, arrow_type[kind]) for path, kind in _kinds(campaign).items()]
    return pa.schema(fields)


def _kinds(campaign: Campaign) -> dict[str, type]:
    """Type of the column of each parameter."""
    kinds: dict[str, type] = {}
    for path, range_ in campaign.spec.parameters.items():
        types = {type(value) for value in range_.values}
        kinds[path] = float if range_.is_continuous else next(iter(types)) if len(types) == 1 else str
        if types == {int, float}:
            kinds[path] = float
    return kinds


def _as(kind: type, value: Any) -> Any:
    return value if type(value) is kind else float(value) if kind is float else json.dumps(value)


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.parquet"))


def _parquet() -> Any:
    try:
        from pyarrow import parquet  # noqa: PLC0415  an extra
    except ModuleNotFoundError:
        raise AutodriveError(missing("pyarrow", "campaigns")) from None
    return parquet
