"""Keys of runs: the hash of everything that decides a result. Also the rows of earlier campaigns, by key."""

from __future__ import annotations

import hashlib
import json
import logging
import os
import sqlite3
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from autodrive.base.cache import PACKAGE, cache_folder, sources
from autodrive.base.python_files import FUNCTION
from autodrive.base.version import __version__
from autodrive.experiments.campaigns import parameters
from autodrive.experiments.campaigns.campaign import Campaign, Run
from autodrive.experiments.campaigns.runner import Result
from autodrive.scenario.files import files_of

log = logging.getLogger(__name__)

ROWS = cache_folder("campaigns").with_name("campaigns") / "rows.sqlite"
"""The rows of all campaigns of this user."""
KEPT = ("metrics", "end", "time", "digest")
"""Of a result."""


class RunKeys:
    """The keys of the runs of a campaign."""

    def __init__(self, campaign: Campaign) -> None:
        spec = campaign.spec
        self._campaign = campaign
        self._base = _hash(
            *versions(),
            campaign.scenario.model_dump_json(),
            *(f"{file.name}\n{file.read_bytes().hex()}" for file in sorted(own_files(campaign))),
            *(spec.driver, spec.stop.model_dump_json(), json.dumps(spec.metrics), campaign.vehicle, str(spec.cameras)),
        )
        self._files: dict[str, str] = {}

    def of(self, run: Run) -> str:
        """The key of a run."""
        named = {path: one for path, one in run.values.items() if path in ("map", "race") or path.endswith(".type")}
        names = json.dumps(named)
        if names not in self._files:
            texts = files_of(parameters.applied(self._campaign.descriptions, named).specs)
            self._files[names] = _hash(*(f"{name.partition('/')[0]}\n{texts[name]}" for name in sorted(texts)))
        return _hash(self._base, self._files[names], json.dumps(run.values, sort_keys=True), str(run.seed))


class RowCache:
    """Results of all campaigns of this user, by key.

    If no file can be written, those of this process only, with a warning.
    """

    def __init__(self, path: Path | None = None) -> None:
        path = path or ROWS
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._rows = sqlite3.connect(path, timeout=60.0)
            self._rows.execute("PRAGMA journal_mode=WAL")
        except (OSError, sqlite3.OperationalError) as error:
            log.warning("results are not kept for other campaigns: %s  (%s)", error, path)
            self._rows = sqlite3.connect(":memory:")
        self._rows.execute("CREATE TABLE IF NOT EXISTS rows (key TEXT PRIMARY KEY, row TEXT) WITHOUT ROWID")

    def get(self, key: str, number: int) -> Result | None:
        """The result of the run with that key; None if it is not known."""
        found = self._rows.execute("SELECT row FROM rows WHERE key = ?", (key,)).fetchone()
        if found is None:
            return None
        return Result(number, **json.loads(found[0]))

    def add(self, rows: Iterable[tuple[str, Result]]) -> None:
        """Keep results; those with an error are not kept."""
        with self._rows:
            self._rows.executemany(
                "INSERT OR REPLACE INTO rows VALUES (?, ?)",
                [(key, json.dumps({name: getattr(one, name) for name in KEPT})) for key, one in rows if not one.error],
            )

    def close(self) -> None:
        """Close the file."""
        self._rows.close()


def own_files(campaign: Campaign) -> set[Path]:
    """Files of the user that decide results: `files`, and those of driver, metrics and sensors with their modules."""
    spec, folder = campaign.spec, campaign.folder
    names = [found["file"] for one in (spec.driver, *spec.metrics) if (found := FUNCTION.fullmatch(one))]
    if policy := campaign.policy:
        names.append(os.path.relpath(policy, folder))
    elif not FUNCTION.fullmatch(spec.driver):
        names += [word for word in spec.driver.split() if (folder / word).is_file()]
    names += [
        path.rpartition(":")[0] for one in campaign.scenario.vehicles.values() for path in one.own_sensors.values()
    ]
    files = {folder / name for name in (*spec.files, *names)}
    return files | {one for name in names if name.endswith(".py") for one in sources(folder / name, is_own=True)}


def versions() -> tuple[str, ...]:
    """Versions of the packages that decide results; the last one is the hash of the sources of this package."""
    return __version__, version("mujoco-core"), version("numpy"), _package()


def _package() -> str:
    """Hash of the sources of this package: a version in development changes without its number."""
    files = sorted(path for path in PACKAGE.rglob("*.py") if "cli" not in path.relative_to(PACKAGE).parts[:1])
    return _hash(*(f"{path.relative_to(PACKAGE).as_posix()} {path.read_text(encoding='utf-8')}" for path in files))


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
