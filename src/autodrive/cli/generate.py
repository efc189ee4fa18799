"""Writes every shipped vehicle, module and map as a .glb file: `scripts/generate [FOLDER]`.

Also writes lights.json: sun, sky and lamps of the camera renderer.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from autodrive.base.cache import make_folder, write_file
from autodrive.base.errors import AutodriveError
from autodrive.graphics.assets.asset import Asset, Detail
from autodrive.graphics.assets.glb import write_glb
from autodrive.graphics.meshes import store
from autodrive.graphics.render.look import light_table
from autodrive.scenario.kinds import names
from autodrive.scenario.maps.draw import module_alone
from autodrive.scenario.maps.map import Map, load_map
from autodrive.scenario.vehicles.spec import load_vehicle

FOLDER = Path("build/assets")
DETAILS: tuple[Detail, ...] = ("full", "reduced", "shadow")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the files and print a table of their contents. Raises `AutodriveError`."""
    parser = argparse.ArgumentParser(prog="scripts/generate", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER, help="default: %(default)s")
    parser.add_argument(
        "--all-details",
        action="store_true",
        help="write the levels of detail and the shadow proxies too, as nodes NAME_lod1 and NAME_shadow (most "
        "glTF viewers show all of them at once)",
    )
    options = parser.parse_args(arguments)
    details = DETAILS if options.all_details else ("full",)
    print(f"{'file':<40} {'nodes':>6} {'full':>7} {'reduced':>8} {'shadow':>7} {'kB':>7}")
    for path, asset in everything():
        file = options.folder / path
        make_folder(file.parent)
        write_file(file, write_glb(asset, details))
        full, reduced, shadow = (asset.triangle_count(detail) for detail in DETAILS)
        size = file.stat().st_size / 1e3
        print(f"{path!s:<40} {len(asset.nodes):6} {full:7} {reduced:8} {shadow:7} {size:7.0f}")
    write_file(options.folder / "lights.json", json.dumps(light_table(), indent=2) + "\n")
    print(f"written to {options.folder.resolve()}")


def everything() -> Iterator[tuple[Path, Asset]]:
    """Path in the folder, and asset, of each file."""
    for name in names("vehicle"):
        yield Path("vehicles") / f"{name}.glb", store.vehicle(load_vehicle(name))
    for name in names("module"):
        yield Path("modules") / f"{name}.glb", _module(module_alone(name))
    for name in names("map"):
        yield Path("maps") / f"{name}.glb", store.ground(load_map(name))


def _module(alone: Map) -> Asset:
    """Movable boxes are not part of the asset of a map."""
    return store.box(alone.boxes[0].size) if alone.boxes else store.ground(alone)


if __name__ == "__main__":
    try:
        main()
    except AutodriveError as error:
        sys.exit(f"generate: {error}")
