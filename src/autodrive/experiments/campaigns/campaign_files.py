"""The files of a campaign as they were at one time: what its runs read, here and on other machines."""

from __future__ import annotations

import contextlib
import os
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from autodrive.base.cache import PACKAGE
from autodrive.base.errors import AutodriveError
from autodrive.base.python_files import FUNCTION, copied, opaque, own_paths, sources
from autodrive.base.specs import is_yaml
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.runner import Result


@dataclass(frozen=True)
class CampaignFiles:
    """A campaign and the files that its runs read, besides those of its scenario: of driver, metrics and `files`."""

    campaign: Campaign
    root: Path
    """Folder that contains all files and the working directory."""
    directory: Path
    """Working directory, from the root."""
    files: dict[str, bytes]
    """By path from the root."""
    paths: tuple[str, ...] = ()
    """Folders of the user in `sys.path`."""

    @classmethod
    def read(cls, campaign: Campaign) -> CampaignFiles:
        """The campaign with its files as they are now; those of the package are where the package is.

        Raises `AutodriveError` if a file cannot be read.
        """
        directory, folder = Path.cwd(), Path(os.path.abspath(campaign.folder))
        try:
            files = own_files(campaign) | {Path(name) for name in _values(campaign)}
            paths = {path for file in files if not (path := Path(os.path.abspath(file))).is_relative_to(PACKAGE)}
            root = Path(os.path.commonpath([*(path.parent for path in paths), folder, directory]))
            contents = {path.relative_to(root).as_posix(): path.read_bytes() for path in sorted(paths)}
        except OSError as error:
            raise AutodriveError(f"cannot read: {error.strerror}  ({error.filename})") from None
        return cls(replace(campaign, folder=folder), root, directory.relative_to(root), contents, own_paths())

    @property
    def opaque(self) -> str:
        """Places in the files that run code which no file names, so that it may not be one of them; empty without."""
        if any(name.endswith(".py") for name in self.campaign.spec.files):
            return ""
        places = [place for name in self.files if name.endswith(".py") for place in opaque(name, self.files[name])]
        return "; ".join(places[:3]) + (f"; and {len(places) - 3} more" if places[3:] else "")

    @classmethod
    def pack(cls, campaign: Campaign) -> CampaignFiles:
        """The same for other machines. Raises `AutodriveError` also for a file that would not be found there."""
        spec = campaign.spec
        for name in (*spec.driver.split(), *spec.metrics, *spec.files, *_values(campaign)):
            file = Path(name.partition(":")[0])
            if file.is_absolute() and (is_yaml(file) or file.suffix in {".py", ".npz"}):
                raise AutodriveError(
                    f"'{name}' cannot travel to other machines: give its path from the folder of the campaign"
                )
        return cls.read(campaign)

    def unpack(self, target: Path) -> Campaign:
        """Write the files into a folder and make the working directory there; the campaign with the paths there."""
        for name, content in self.files.items():
            path = target / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        folder = target / self.campaign.folder.relative_to(self.root)
        for one in (folder, target / self.directory):
            one.mkdir(parents=True, exist_ok=True)
        descriptions, spec = self.campaign.descriptions, self.campaign.spec
        scenario = descriptions.specs.scenario
        vehicles = {
            name: one.model_copy(
                update={"own_sensors": {key: self._there(path, target) for key, path in one.own_sensors.items()}}
            )
            for name, one in scenario.vehicles.items()
        }
        specs = replace(descriptions.specs, scenario=scenario.model_copy(update={"vehicles": vehicles}))
        driver = shlex.split(spec.driver) if "{port}" in spec.driver else [spec.driver]
        words = [self._there(word, target) if Path(word).is_absolute() else word for word in driver]
        changes = {
            "driver": shlex.join(words) if len(words) > 1 else words[0],
            "metrics": tuple(self._there(one, target) if Path(one).is_absolute() else one for one in spec.metrics),
        }
        return replace(
            self.campaign,
            spec=spec.model_copy(update=changes),
            folder=folder,
            descriptions=replace(descriptions, specs=specs),
        )

    def _there(self, file: str, target: Path) -> str:
        """The path of a file of the user in that folder; of another file, the path that it has."""
        path, colon, name = file.rpartition(":") if ".py:" in file else (file, "", "")
        inside = os.path.relpath(path, self.root)
        return f"{target / inside}{colon}{name}" if Path(inside).as_posix() in self.files else file


@dataclass(frozen=True)
class Workplace:
    """Where a process runs a campaign: on copies of its files."""

    campaign: Campaign
    """Its paths are those of the copies."""
    directory: Path
    """Working directory of the runs."""
    root: Path
    """Folder of the copies of the files below `original`."""
    original: Path
    paths: tuple[str, ...]
    """Folders of the user in `sys.path`, whose copies are imported."""

    @contextlib.contextmanager
    def entered(self) -> Iterator[None]:
        """In the block, this process and those that it starts import the copies."""
        before, variable = [*sys.path], os.environ.get("PYTHONPATH")
        inside = [path for path in self.paths if Path(path).is_relative_to(self.original)]
        copies = {path: str(self.root / os.path.relpath(path, self.original)) for path in inside}
        copies = {path: copy for path, copy in copies.items() if os.path.isdir(copy)}
        sys.path[:] = [copies.get(os.path.abspath(path), path) for path in dict.fromkeys([*before, *self.paths])]
        if variable:
            words = variable.split(os.pathsep)
            os.environ["PYTHONPATH"] = os.pathsep.join(copies.get(os.path.abspath(word), word) for word in words)
        try:
            with copied(self.original, self.root):
                yield
        finally:
            sys.path[:] = before
            if variable:
                os.environ["PYTHONPATH"] = variable


class Snapshot:
    """A folder with copies of the files of a campaign, from which it runs; the originals may change meanwhile.

    Each copy has the path from this folder that the original has from the root of the file system. Everything else
    beside the originals is there, too, as a link.
    """

    def __init__(self, files: CampaignFiles) -> None:
        """Raises `AutodriveError` if it cannot be written."""
        self._files = files
        self._stack = contextlib.ExitStack()
        try:
            folder = tempfile.TemporaryDirectory(prefix="autodrive-campaign-", ignore_cleanup_errors=True)
            self._folder = Path(os.path.realpath(self._stack.enter_context(folder)))
            self.root = self._folder / files.root.relative_to(files.root.anchor)
            """The copy of the root of the files."""
            self.campaign = files.unpack(self.root)
            for name in files.files:
                with contextlib.suppress(FileNotFoundError):
                    shutil.copymode(files.root / name, self.root / name)  # a script may be a program
            self._linked = self._link()
        except OSError as error:
            self._stack.close()
            raise AutodriveError(f"the files of the campaign cannot be copied: {error.strerror}") from None
        named = {os.path.abspath(files.campaign.folder / name) for name in files.campaign.spec.files}
        here = files.root / files.directory
        reads_here = any(
            Path(name).is_relative_to(here) for name in (*named, *map(os.path.abspath, _values(files.campaign)))
        )
        directory = self.root / files.directory if reads_here else here
        self.workplace = Workplace(self.campaign, directory, self.root, files.root, files.paths)
        """Its working directory is a copy if one of `files` is in it."""

    def named(self, result: Result) -> Result:
        """The result; its error names the originals."""
        return replace(result, error=result.error.replace(str(self._folder) + os.sep, self._files.root.anchor))

    def close(self) -> None:
        """Move what the runs have written beside the copies to the originals, and remove the folder."""
        with contextlib.suppress(OSError):
            for copy, original in self._folders():
                for entry in [*os.scandir(copy)] if copy.is_dir() else []:
                    path, target = Path(entry.path), original / entry.name
                    is_new = not entry.is_symlink() and entry.name != "__pycache__" and path not in self._copies
                    if is_new and (path in self._linked or not os.path.lexists(target)):
                        shutil.move(path, target)
        self._stack.close()

    def _folders(self) -> list[tuple[Path, Path]]:
        """The folders of the copies that are no links, and their originals."""
        anchor = Path(self._files.root.anchor)
        folders = self._copies - {self.root / name for name in self._files.files}
        return [(copy, anchor / copy.relative_to(self._folder)) for copy in sorted(folders)]

    def _link(self) -> set[Path]:
        """Links to everything beside the originals, where the system has links."""
        self._copies = {self.root / name for name in self._files.files}
        self._copies |= {self.campaign.folder, self.root / self._files.directory}
        self._copies |= {copy for path in self._copies for copy in path.parents if copy.is_relative_to(self._folder)}
        linked = set[Path]()
        for copy, original in self._folders():
            with contextlib.suppress(OSError, NotImplementedError):
                for entry in os.scandir(original):
                    path = copy / entry.name
                    if entry.name != "__pycache__" and path not in self._copies:
                        path.symlink_to(entry.path)
                        linked.add(path)
        return linked


def own_files(campaign: Campaign) -> set[Path]:
    """Files of the user that decide results: `files`, and those of driver, metrics and sensors with their modules."""
    spec, folder = campaign.spec, campaign.folder
    names = [found["file"] for one in (spec.driver, *spec.metrics) if (found := FUNCTION.fullmatch(one))]
    if policy := campaign.policy:
        names.append(os.path.relpath(policy, folder))
    elif not FUNCTION.fullmatch(spec.driver):
        names += [word for word in shlex.split(spec.driver) if (folder / word).is_file()]
    names += [
        path.rpartition(":")[0] for one in campaign.scenario.vehicles.values() for path in one.own_sensors.values()
    ]
    files = {folder / name for name in (*spec.files, *names)}
    return files | {one for name in names if name.endswith(".py") for one in sources(folder / name)}


def _values(campaign: Campaign) -> Iterator[str]:
    """Files that are values of parameters."""
    for one in campaign.spec.parameters.values():
        for value in one.values:
            if isinstance(value, str) and is_yaml(value) and Path(value).is_file():
                yield value
