"""Runs on a Ray cluster: actors with a worker process each. A node that dies loses nothing."""

from __future__ import annotations

import contextlib
import logging
import os
import socket
import tempfile
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from autodrive.base.cache import make_folder, write_file
from autodrive.base.code_snapshot import Workplace
from autodrive.base.errors import AutodriveError
from autodrive.base.installation import missing
from autodrive.experiments.campaigns.campaign import Campaign, CampaignRun
from autodrive.experiments.campaigns.campaign_files import CampaignFiles
from autodrive.experiments.campaigns.keys import versions
from autodrive.experiments.campaigns.runner import RunResult
from autodrive.experiments.campaigns.worker import CampaignWorker

LOCAL, AUTO = "local", "auto"
"""A cluster on this machine that ends with the campaign; the cluster that this machine is in."""
CONNECT_TIME = 10.0
"""A cluster that does not accept a connection within that time is not there [s]."""
LONGEST_FOLDER = 35
"""Longest path of the folder of temporary files [bytes]: Ray has sockets in it, whose paths have at most 107 bytes (103
on macOS)."""
END_TIME = 5.0
"""An actor that has not removed its files after that time is ended [s]."""
LOSSES = 3
"""Number of times that each actor may be lost without a result in between; then something is wrong with all of them."""


class Remote:
    """An actor on a node of the cluster: it unpacks the campaign and runs runs in a worker process."""

    def prepare(self, files: CampaignFiles) -> tuple[str, ...]:
        """Unpack the campaign; the versions here of what decides a result."""
        self._folder = tempfile.TemporaryDirectory(prefix="autodrive-campaign-")
        target = Path(self._folder.name)
        directory = target / files.directory
        workplace = Workplace(directory, target, files.root, files.paths)
        self._worker = CampaignWorker(files.unpack(target), workplace)
        os.chdir(directory)  # an actor has its process alone
        return versions()

    def run(self, run: CampaignRun) -> tuple[RunResult, bytes]:
        """The result of a run, and its recording."""
        path = Path(self._folder.name) / "recording.mcap"
        result = self._worker.run(replace(run, recording=str(path)) if run.recording else run)
        if not result.recording:
            return result, b""
        recording = path.read_bytes()
        path.unlink()
        return replace(result, recording=run.recording), recording

    def close(self) -> None:
        """End the run that another thread waits for, and remove the files of the campaign."""
        self._worker.close()
        self._folder.cleanup()


class RayExecutor:
    """One actor for each processor of the cluster; a new one is started when one is lost.

    A run goes to an actor that is free. If its node dies, the run goes to another one, so that each run has exactly one
    result.
    """

    def __init__(self, campaign: Campaign, address: str = LOCAL, workers: int | None = None) -> None:
        """`address`: 'local', 'auto' (the cluster that this machine is in), HOST:PORT of a head, or 'ray://HOST:PORT'.

        Raises `AutodriveError` if Ray is not installed, the cluster is not there, or a file cannot travel.
        """
        try:
            import ray  # noqa: PLC0415  an extra
        except ModuleNotFoundError:
            raise AutodriveError(missing("ray", "ray")) from None
        self._ray: Any = ray
        self.files = CampaignFiles.pack(campaign)
        """What the runs read."""
        self._is_own = not ray.is_initialized()
        self._folders = contextlib.ExitStack()
        """Folders that Ray needs as long as it runs."""
        if self._is_own:
            try:
                self._connect(address)
            except BaseException:
                self._folders.close()
                raise
        self._files = ray.put(self.files)
        self._actor: Any = self._ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0, max_concurrency=2)(Remote)
        self._versions = versions()
        self._runs: deque[CampaignRun] = deque()
        self._busy: dict[Any, tuple[Any, CampaignRun | None]] = {}
        """Reference of what an actor does -> the actor, and its run; None: it starts."""
        self._idle: list[Any] = []
        self._pending = self._losses = 0
        self.size = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
        """Number of actors."""
        for _ in range(self.size):
            self._start_actor()

    def submit(self, run: CampaignRun) -> None:
        """Run it as soon as an actor is free."""
        self._pending += 1
        self._runs.append(run)
        self._distribute()

    def results(self) -> Iterator[RunResult]:
        """Results as runs end. Raises `AutodriveError` if the nodes cannot run the campaign."""
        while self._pending:
            # All that have ended at once: with hundreds of actors, a look at all of them takes milliseconds.
            done, _ = self._ray.wait([*self._busy], num_returns=len(self._busy), timeout=0)
            if not done:
                done, _ = self._ray.wait([*self._busy])
            for reference in done:
                actor, run = self._busy.pop(reference)
                answer = self._answer(reference, actor, run)
                self._distribute()
                if answer is not None:
                    self._pending -= 1
                    yield kept_here(*answer)

    def cancel(self) -> None:
        """End the actors, and Ray if this executor has started it."""
        actors = [*self._idle, *(actor for actor, _ in self._busy.values())]
        if actors:
            self._ray.wait([actor.close.remote() for actor in actors], num_returns=len(actors), timeout=END_TIME)
        for actor in actors:
            self._ray.kill(actor)
        self._runs.clear()
        self._busy.clear()
        self._idle.clear()
        self._pending = 0
        if self._is_own:
            self._ray.shutdown()
        self._folders.close()

    def _connect(self, address: str) -> None:
        if address not in (LOCAL, AUTO):
            host, _, port = address.removeprefix("ray://").rpartition(":")
            try:  # Ray would try for a minute and print pages
                socket.create_connection((host, int(port)), CONNECT_TIME).close()
            except ValueError:
                raise AutodriveError(
                    f"'{address}' is not an address of a Ray cluster: give HOST:PORT, '{AUTO}' or '{LOCAL}'"
                ) from None
            except OSError as error:
                raise AutodriveError(f"there is no Ray cluster at '{address}': {error.strerror or error}") from None
        temporary = os.fsencode(os.environ.get("RAY_TMPDIR", os.environ.get("TMPDIR", "")))
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # Ray would report to its makers what it is used for
        places = {"_temp_dir": self._short_folder()} if address == LOCAL and len(temporary) > LONGEST_FOLDER else {}
        try:
            # Ray lets all workers import from its working directory first: a file numpy.py there would replace the
            # package. The files of the campaign travel in another way.
            with contextlib.chdir(self._folder()):
                self._ray.init(address=address, log_to_driver=False, logging_level=logging.ERROR, **places)
        except (ConnectionError, ImportError, ValueError, RuntimeError) as error:
            (text, *_) = str(error).splitlines() or [type(error).__name__]
            raise AutodriveError(f"there is no Ray cluster at '{address}': {text}") from None

    def _folder(self, parent: str | None = None) -> str:
        """A new folder, which is removed at the end; `parent` None: where temporary files are."""
        folder = tempfile.TemporaryDirectory(prefix="autodrive-ray-", dir=parent, ignore_cleanup_errors=True)
        return self._folders.enter_context(folder)

    def _short_folder(self) -> str:
        """A new folder with a short path. Raises `AutodriveError`."""
        try:
            return self._folder("/tmp")
        except OSError as error:
            raise AutodriveError(
                "the path of the folder of temporary files is too long for Ray: set RAY_TMPDIR to a folder with a path "
                f"of at most {LONGEST_FOLDER} bytes  (/tmp: {error.strerror})"
            ) from None

    def _answer(self, reference: Any, actor: Any, run: CampaignRun | None) -> tuple[RunResult, bytes] | None:
        """What an actor has answered; None if it has started, or is lost: then its run waits for another one."""
        errors = self._ray.exceptions
        try:
            answer = self._ray.get(reference)
        except errors.RayTaskError as error:
            text = " ".join(str(error.cause).split())[:300]
            raise AutodriveError(f"a node of the cluster cannot run the campaign: {text}") from None
        except errors.RayError as error:
            self._losses += 1
            if self._losses > LOSSES * self.size:
                text = " ".join(str(error).split())[:300]
                raise AutodriveError(f"the processes on the cluster end before a run ends: {text}") from None
            with contextlib.suppress(errors.RayError):
                self._ray.kill(actor)  # one that cannot be reached may still run
            if run is not None:
                self._runs.appendleft(run)
            self._start_actor()  # it waits until there is a free processor
            return None
        self._losses = 0
        self._idle.append(actor)
        if run is not None:
            return answer
        if answer != self._versions:
            here, there = (", ".join(versions[:-1]) for versions in (self._versions, answer))
            raise AutodriveError(
                "a node of the cluster has another autodrive, mujoco-core or numpy, or other sources of autodrive: "
                f"{there} instead of {here}"
            )
        return None

    def _start_actor(self) -> None:
        actor = self._actor.remote()
        self._busy[actor.prepare.remote(self._files)] = actor, None

    def _distribute(self) -> None:
        while self._runs and self._idle:
            actor, run = self._idle.pop(), self._runs.popleft()
            self._busy[actor.run.remote(run)] = actor, run


def kept_here(result: RunResult, recording: bytes) -> RunResult:
    """The result, with its recording written here."""
    if result.recording:
        path = Path(result.recording)
        make_folder(path.parent)
        write_file(path, recording)
    return result
