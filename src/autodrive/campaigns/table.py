"""The table of a campaign: Parquet files that grow while runs end, and one sorted file at the end."""

from __future__ import annotations

import io
import json
import math
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from autodrive.cache import make_folder, write_file
from autodrive.campaigns.campaign import Campaign, Run
from autodrive.campaigns.runner import Result
from autodrive.campaigns.sampling import missing
from autodrive.errors import AutodriveError

if TYPE_CHECKING:
    import pyarrow

PART_TIME, PART_ROWS = 5.0, 5000
"""A part is written after that time [s], or with so many rows."""
FIRST = ("run", "sample", "seed", "status", "margin", "end", "time", "error", "recording", "key")
"""Columns before those of metrics and parameters."""


class Table:
    """Rows of a campaign in a folder: `parts/*.parquet` while it runs, `table.parquet` when it has ended."""

    def __init__(self, folder: Path, campaign: Campaign) -> None:
        """Raises `AutodriveError` if pyarrow is not installed."""
        self._parquet = _parquet()
        self._campaign = campaign
        self.path = folder / "table.parquet"
        self._parts = folder / "parts"
        self._schema = schema(campaign)
        self._rows: list[dict[str, Any]] = []
        self._written = time.monotonic()
        self._count = 0

    def earlier(self) -> Iterator[dict[str, Any]]:
        """Rows of an earlier, also a broken, campaign in this folder. Raises `AutodriveError` for another file."""
        for path in (self.path, *sorted(self._parts.glob("*.parquet"))):
            if path.is_file():
                try:
                    table = self._parquet.read_table(path)
                    table.schema.field("key")
                except (ValueError, KeyError):  # pyarrow's errors of wrong files are ValueErrors
                    raise AutodriveError(
                        f"{path} is not a table of a campaign; delete it, or choose another folder (--output)"
                    ) from None
                yield from table.to_pylist()

    def run(self, number: int) -> Run | None:
        """The run of that number, with the parameters in the table; None if it is not there."""
        kinds, types = _kinds(self._campaign), self._campaign.spec.parameters
        for row in self.earlier():
            if row["run"] == number and row.keys() >= kinds.keys():
                values = {path: row[path] for path in kinds}
                for path, kind in kinds.items():
                    if kind is str and not all(isinstance(one, str) for one in types[path].values):
                        values[path] = json.loads(row[path])
                return Run(number, row["sample"], row["seed"], values)
        return None

    def start(self) -> None:
        """Begin with an empty table: rows of earlier campaigns that still hold are added again."""
        shutil.rmtree(self._parts, ignore_errors=True)
        make_folder(self._parts)

    def add(self, run: Run, key: str, result: Result) -> dict[str, Any]:
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
            self._count += 1
            self._write(_table(self._rows, self._schema), self._parts / f"{self._count:06d}.parquet")
        self._rows, self._written = [], time.monotonic()

    def finish(self) -> pyarrow.Table:
        """Write the sorted table; the same rows give the same bytes."""
        import pyarrow as pa  # noqa: PLC0415  an extra

        self.write_part()
        parts = [self._parquet.read_table(path) for path in sorted(self._parts.glob("*.parquet"))]
        table = pa.concat_tables(parts) if parts else self._schema.empty_table()
        table = table.sort_by("run").combine_chunks().replace_schema_metadata(None)
        self._write(table, self.path)
        shutil.rmtree(self._parts, ignore_errors=True)
        return table

    def _write(self, table: pyarrow.Table, path: Path) -> None:
        data = io.BytesIO()
        self._parquet.write_table(table, data)
        write_file(path, data.getvalue())


def row_of(campaign: Campaign, run: Run, key: str, result: Result) -> dict[str, Any]:
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
        "error": result.error,
        "recording": Path(result.recording).name if result.recording else "",
        "key": key,
        **{name: None if math.isnan(value) else value for name, value in metrics.items()},
        **{path: _as(kind, run.values[path]) for path, kind in _kinds(campaign).items()},
    }


def schema(campaign: Campaign) -> pyarrow.Schema:
    """Names and types of the columns."""
    import pyarrow as pa  # noqa: PLC0415  an extra

    types = {"run": pa.int64(), "sample": pa.int64(), "seed": pa.int64(), "margin": pa.float64(), "time": pa.float64()}
    of = {float: pa.float64(), int: pa.int64(), bool: pa.bool_(), str: pa.string()}
    fields = [(name, types.get(name, pa.string())) for name in FIRST]
    fields += [(name, pa.float64()) for name in campaign.metric_names]
    fields += [(path, of[kind]) for path, kind in _kinds(campaign).items()]
    return pa.schema(fields)


def _kinds(campaign: Campaign) -> dict[str, type]:
    """Type of the column of each parameter."""
    kinds: dict[str, type] = {}
    for path, one in campaign.spec.parameters.items():
        types = {type(value) for value in one.values}
        kinds[path] = float if one.is_continuous else next(iter(types)) if len(types) == 1 else str
        if types == {int, float}:
            kinds[path] = float
    return kinds


def _as(kind: type, value: Any) -> Any:
    return value if type(value) is kind else float(value) if kind is float else json.dumps(value)


def _table(rows: list[dict[str, Any]], columns: pyarrow.Schema) -> pyarrow.Table:
    import pyarrow as pa  # noqa: PLC0415  an extra

    return pa.Table.from_pylist(rows, schema=columns)


def _parquet() -> Any:
    try:
        from pyarrow import parquet  # noqa: PLC0415  an extra
    except ModuleNotFoundError:
        raise AutodriveError(missing("pyarrow", "campaigns")) from None
    return parquet
