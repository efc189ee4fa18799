"""The files of a campaign as they were at one time: what its runs read, here and on other machines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from autodrive.base.code_snapshot import Code
from autodrive.base.errors import AutodriveError
from autodrive.base.python_files import FUNCTION, script_files, sources
from autodrive.base.specs import is_yaml
from autodrive.experiments.campaigns.campaign import Campaign


@dataclass(frozen=True)
class CampaignFiles(Code):
    """A campaign and the files that its runs read, besides those of its scenario: of driver, metrics and `files`."""

    campaign: Campaign
    """The campaign, whose folder is absolute."""

    @classmethod
    def of(cls, campaign: Campaign) -> CampaignFiles:
        """The campaign with its files as they are now. Raises `AutodriveError` if a file cannot be read."""
        code = Code.read(own_files(campaign), campaign.folder)
        return cls(**vars(code), campaign=replace(campaign, folder=code.root / code.folder))

    @property
    def opaque(self) -> str:
        """Code that the files do not name, see `Code.opaque`; empty if `files` names code."""
        return "" if any(name.endswith(".py") for name in self.campaign.spec.files) else super().opaque

    @property
    def data(self) -> list[Path]:
        """Files that are read, not run."""
        return [*(self.campaign.folder / name for name in self.campaign.spec.files), *map(Path, _values(self.campaign))]

    @classmethod
    def pack(cls, campaign: Campaign) -> CampaignFiles:
        """Files of a campaign for other machines.

        Raises `AutodriveError` also for a file that would not be found there.
        """
        spec = campaign.spec
        for name in (*spec.driver.split(), *spec.metrics, *spec.files, *_values(campaign)):
            file = Path(name.partition(":")[0])
            if file.is_absolute() and (is_yaml(file) or file.suffix in {".py", ".npz"}):
                raise AutodriveError(
                    f"'{name}' cannot be copied to other machines: give a path relative to the folder of the campaign"
                )
        return cls.of(campaign)

    def unpack(self, target: Path) -> Campaign:
        """Write the files into a folder and make the working directory there; the campaign with the paths there."""
        self.write(target)
        return self.campaign_in(target)

    def campaign_in(self, target: Path) -> Campaign:
        """The campaign with the paths of copies in that folder."""
        descriptions, spec = self.campaign.descriptions, self.campaign.spec
        scenario = descriptions.specs.scenario
        vehicles = {
            name: placement.model_copy(
                update={"own_sensors": {key: self.copy_of(path, target) for key, path in placement.own_sensors.items()}}
            )
            for name, placement in scenario.vehicles.items()
        }
        specs = replace(descriptions.specs, scenario=scenario.model_copy(update={"vehicles": vehicles}))
        is_script = "{port}" in spec.driver
        changes = {
            "driver": self.command_with_copies(spec.driver, target) if is_script else self._there(spec.driver, target),
            "metrics": tuple(self._there(metric, target) for metric in spec.metrics),
        }
        return replace(
            self.campaign,
            spec=spec.model_copy(update=changes),
            folder=target / self.folder,
            descriptions=replace(descriptions, specs=specs),
        )

    def _there(self, name: str, target: Path) -> str:
        """An absolute path is that of the copy."""
        return self.copy_of(name, target) if Path(name).is_absolute() else name


def own_files(campaign: Campaign) -> Iterator[Path]:
    """Files of the user that decide results: of driver, metrics and sensors with their modules, and other data.

    Raises `OSError` if one cannot be read.
    """
    spec, folder = campaign.spec, campaign.folder
    yield from (folder / name for name in spec.files)
    yield from map(Path, _values(campaign))
    names = [match["file"] for name in (spec.driver, *spec.metrics) if (match := FUNCTION.fullmatch(name))]
    names += [
        path.rpartition(":")[0]
        for placement in campaign.scenario.vehicles.values()
        for path in placement.own_sensors.values()
    ]
    for name in names:
        yield from sources(folder / name)
    if policy := campaign.policy:
        yield policy
    elif not FUNCTION.fullmatch(spec.driver):
        yield from script_files(spec.driver, folder)


def _values(campaign: Campaign) -> Iterator[str]:
    """Files that are values of parameters."""
    for range_ in campaign.spec.parameters.values():
        for value in range_.values:
            if isinstance(value, str) and is_yaml(value) and Path(value).is_file():
                yield value
