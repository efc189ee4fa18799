"""The files of a campaign as one value that travels to other machines."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from autodrive.base.cache import PACKAGE
from autodrive.base.errors import AutodriveError
from autodrive.base.specs import is_yaml
from autodrive.experiments.campaigns.campaign import Campaign
from autodrive.experiments.campaigns.keys import own_files


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

    @classmethod
    def pack(cls, campaign: Campaign) -> CampaignFiles:
        """The campaign with its files; those of the package are where the package is.

        Raises `AutodriveError` for a file that would not be found on another machine.
        """
        spec, directory, folder = campaign.spec, Path.cwd(), Path(os.path.abspath(campaign.folder))
        for name in (*spec.driver.split(), *spec.metrics, *spec.files, *_values(campaign)):
            file = Path(name.partition(":")[0])
            if file.is_absolute() and (is_yaml(file) or file.suffix in {".py", ".npz"}):
                raise AutodriveError(
                    f"'{name}' cannot travel to other machines: give its path from the folder of the campaign"
                )
        files = own_files(campaign) | {Path(name) for name in _values(campaign)}
        paths = {path for file in files if not (path := Path(os.path.abspath(file))).is_relative_to(PACKAGE)}
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
        descriptions = self.campaign.descriptions
        scenario = descriptions.specs.scenario
        vehicles = {
            name: one.model_copy(
                update={"own_sensors": {key: self._there(path, target) for key, path in one.own_sensors.items()}}
            )
            for name, one in scenario.vehicles.items()
        }
        specs = replace(descriptions.specs, scenario=scenario.model_copy(update={"vehicles": vehicles}))
        return replace(self.campaign, folder=folder, descriptions=replace(descriptions, specs=specs))

    def _there(self, file: str, target: Path) -> str:
        """The path of a file of the user in that folder."""
        return str(target / Path(os.path.abspath(file)).relative_to(self.root))


def _values(campaign: Campaign) -> Iterator[str]:
    """Files that are values of parameters."""
    for one in campaign.spec.parameters.values():
        for value in one.values:
            if isinstance(value, str) and is_yaml(value) and Path(value).is_file():
                yield value
