"""The files of a campaign as one value that travels to other machines."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import yaml

from autodrive.base import specs
from autodrive.base.cache import PACKAGE
from autodrive.base.errors import AutodriveError
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.keys import own_files
from autodrive.scenario import ScenarioSpec
from autodrive.scenario.maps.map import find_map

YAML = {".yaml", ".yml"}


@dataclass(frozen=True)
class Luggage:
    """A campaign and the files that its runs read: those of driver, metrics, `files`, and own files of the scenario."""

    campaign: Campaign
    root: Path
    """Folder that contains all files and the working directory."""
    directory: Path
    """Working directory, from the root."""
    files: dict[str, bytes]
    """By path from the root."""

    @classmethod
    def pack(cls, campaign: Campaign) -> Luggage:
        """The campaign with its files; those of the package are where the package is.

        Raises `AutodriveError` for a file that would not be found on another machine.
        """
        spec, directory, folder = campaign.spec, Path.cwd(), Path(os.path.abspath(campaign.folder))
        for name in (*spec.driver.split(), *spec.metrics, *spec.files, *_values(campaign)):
            if Path(name).is_absolute() and Path(name.partition(":")[0]).suffix in {".py", ".npz", *YAML}:
                raise AutodriveError(
                    f"'{name}' cannot travel to other machines: give its path from the folder of the campaign"
                )
        files = own_files(campaign) | _of_scenario(campaign.scenario) | {Path(name) for name in _values(campaign)}
        paths = {path for file in files if not _is_included(path := Path(os.path.abspath(file)))}
        root = Path(os.path.commonpath([*(path.parent for path in paths), folder, directory]))
        packed = {path.relative_to(root).as_posix(): path.read_bytes() for path in sorted(paths)}
        return cls(replace(campaign, folder=folder), root, directory.relative_to(root), packed)

    def unpack(self, target: Path) -> Campaign:
        """Write the files into a folder and make the working directory there; the campaign with the paths there."""
        for name, content in self.files.items():
            path = target / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        folder = target / self.campaign.folder.relative_to(self.root)
        for one in (folder, target / self.directory):
            one.mkdir(parents=True, exist_ok=True)
        scenario = self.campaign.scenario
        vehicles = {
            name: one.model_copy(
                update={
                    "type": self._there(one.type, target),
                    "own_sensors": {key: self._there(path, target) for key, path in one.own_sensors.items()},
                }
            )
            for name, one in scenario.vehicles.items()
        }
        changes = {"map": self._there(scenario.map, target), "vehicles": vehicles}
        if scenario.race is not None:
            race = {"rules": self._there(scenario.race.rules, target)}
            if scenario.race.track:
                race["track"] = self._there(scenario.race.track, target)
            changes["race"] = scenario.race.model_copy(update=race)
        return replace(self.campaign, folder=folder, scenario=scenario.model_copy(update=changes))

    def _there(self, name: str, target: Path) -> str:
        """The path of a file in that folder; a name of the package stays."""
        if Path(name).suffix not in YAML and ".py:" not in name:
            return name
        return str(target / Path(os.path.abspath(name)).relative_to(self.root))


def _values(campaign: Campaign) -> Iterator[str]:
    """Files that are values of parameters."""
    for one in campaign.spec.parameters.values():
        for value in one.values:
            if isinstance(value, str) and Path(value).suffix in YAML and Path(value).is_file():
                yield value


def _of_scenario(scenario: ScenarioSpec) -> set[Path]:
    """Own files of vehicles, race, map and modules."""
    names = {scenario.map, *(one.type for one in scenario.vehicles.values())}
    if scenario.race is not None:
        names |= {scenario.race.rules, scenario.race.track or ""}
    files = {Path(name) for name in names if Path(name).suffix in YAML}
    if Path(scenario.map) in files:
        map_ = find_map(scenario.map)
        tree = yaml.safe_load(yaml.safe_dump(specs.source(map_).tree))
        modules = {Path(str(one["module"])) for one in tree.get("placements") or ()}
        files |= {map_.parent / one for one in modules if one.suffix in YAML}
    return files


def _is_included(path: Path) -> bool:
    return path.is_relative_to(PACKAGE)
