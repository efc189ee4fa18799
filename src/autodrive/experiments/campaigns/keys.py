"""Keys of runs: the hash of everything that decides a result. Also the rows of earlier campaigns, by key."""

from __future__ import annotations

import contextlib
import hashlib
import json
import logging
import os
import sqlite3
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from autodrive.base.cache import PACKAGE, cache_folder
from autodrive.base.version import __version__
from autodrive.experiments.campaigns import parameters
from autodrive.experiments.campaigns.campaign import CampaignRun
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.runner import RunResult
from autodrive.scenario.files import files_of

log = logging.getLogger(__name__)

ROWS = cache_folder("campaigns").with_name("campaigns") / "rows.sqlite"
"""The rows of all campaigns of this user."""
WAIT = 10.0
"""Longest wait for another process that writes rows [s]."""
KEPT = ("metrics", "end", "time", "digest")
"""What is kept of a result."""


class RunKeys:
    """The keys of the runs of a campaign."""

    def __init__(self, files: CampaignFiles) -> None:
        """Make keys for the campaign with these files, whatever they become."""
        campaign, spec = files.campaign, files.campaign.spec
        contents = sorted((os.path.relpath(name, files.folder), content) for name, content in files.files.items())
        self._campaign = campaign
        self._base = _hash(
            *versions(),
            campaign.scenario.model_dump_json(),
            *(f"{Path(name).name}\n{content.hex()}" for name, content in contents),
            campaign.policy.read_bytes().hex() if campaign.policy and campaign.policy.is_relative_to(PACKAGE) else "",
            *(spec.driver, spec.stop.model_dump_json(), json.dumps(spec.metrics), campaign.vehicle, str(spec.cameras)),
        )
        self._files: dict[str, str] = {}

    def of(self, run: CampaignRun) -> str:
        """The key of a run."""
        named = {path: value for path, value in run.values.items() if path in ("map", "race") or path.endswith(".type")}
        names = json.dumps(named)
        if names not in self._files:
            texts = files_of(parameters.applied(self._campaign.descriptions, named).specs)
            self._files[names] = _hash(*(f"{name.partition('/')[0]}\n{texts[name]}" for name in sorted(texts)))
        return _hash(self._base, self._files[names], json.dumps(run.values, sort_keys=True), str(run.seed))


class RowCache:
    """Results of all campaigns of this user, by key.

    If the file cannot be read or written, also later, those of this process only, with one warning.
    """

    TABLE = "CREATE TABLE IF NOT EXISTS rows (key TEXT PRIMARY KEY, row TEXT) WITHOUT ROWID"

    def __init__(self, path: Path | None = None) -> None:
        self._path = path or ROWS
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._rows = sqlite3.connect(self._path, timeout=WAIT)
            self._rows.execute("PRAGMA journal_mode=WAL")
            self._rows.execute(self.TABLE)
        except (OSError, sqlite3.Error) as error:
            self._give_up(error)

    def get(self, key: str, number: int) -> RunResult | None:
        """The result of the run with that key; None if it is not known."""
        try:
            stored = self._rows.execute("SELECT row FROM rows WHERE key = ?", (key,)).fetchone()
            return None if stored is None else RunResult(number, **json.loads(stored[0]))
        except (sqlite3.Error, ValueError, TypeError) as error:
            self._give_up(error)
            return None

    def add(self, rows: Iterable[tuple[str, RunResult]]) -> None:
        """Keep results; those with an error are not kept."""
        texts = [
            (key, json.dumps({name: getattr(result, name) for name in KEPT}))
            for key, result in rows
            if not result.error
        ]
        try:
            with self._rows:
                self._rows.executemany("INSERT OR REPLACE INTO rows VALUES (?, ?)", texts)
        except sqlite3.Error as error:
            self._give_up(error)

    def close(self) -> None:
        """Close the file."""
        with contextlib.suppress(sqlite3.Error):
            self._rows.close()

    def _give_up(self, error: Exception) -> None:
        """Go on without the file."""
        log.warning("results are not kept for other campaigns: %s  (%s)", error, self._path)
        self._rows = sqlite3.connect(":memory:")
        self._rows.execute(self.TABLE)


def versions() -> tuple[str, ...]:
    """Versions of the packages that decide results; the last one is the hash of the sources of this package."""
    return __version__, version("mujoco-core"), version("numpy"), _package()


def _package() -> str:
    """Hash of the sources of this package: a version in development changes without its number."""
    files = sorted(path for path in PACKAGE.rglob("*.py") if "cli" not in path.relative_to(PACKAGE).parts[:1])
    return _hash(*(f"{path.relative_to(PACKAGE).as_posix()} {path.read_text(encoding='utf-8')}" for path in files))


def _hash(*parts: str) -> str:
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()
