"""Writes every vehicle, module and map that comes with the simulator as a .glb file: `scripts/generate [FOLDER]`.

Beside them lights.json: sun, sky and lamps as the cameras are drawn with.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

from autodrive import assets
from autodrive.descriptions import names
from autodrive.maps.draw import module_alone
from autodrive.maps.map import Map, load_map
from autodrive.render.asset import Asset, Detail
from autodrive.render.glb import write_glb
from autodrive.render.look import light_table
from autodrive.vehicles.spec import load_vehicle

FOLDER = Path("build/assets")
DETAILS: tuple[Detail, ...] = ("full", "reduced", "shadow")


def main(arguments: Sequence[str] | None = None) -> None:
    """Write the files and a table of what is in them."""
    parser = argparse.ArgumentParser(prog="scripts/generate", description=__doc__)
    parser.add_argument("folder", type=Path, nargs="?", default=FOLDER, help="default: %(default)s")
    parser.add_argument(
        "--all-details",
        action="store_true",
        help="write the levels of detail and the shadow proxies too, as nodes NAME_lod1 and NAME_shadow; a viewer that "
        "does not know them would show all at once",
    )
    options = parser.parse_args(arguments)
    details = DETAILS if options.all_details else ("full",)
    print(f"{'file':<40} {'nodes':>6} {'full':>7} {'reduced':>8} {'shadow':>7} {'kB':>7}")
    for path, asset in everything():
        file = options.folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(write_glb(asset, details))
        full, reduced, shadow = (asset.triangle_count(detail) for detail in DETAILS)
        size = file.stat().st_size / 1e3
        print(f"{path!s:<40} {len(asset.nodes):6} {full:7} {reduced:8} {shadow:7} {size:7.0f}")
    (options.folder / "lights.json").write_text(json.dumps(light_table(), indent=2) + "\n", encoding="utf-8")
    print(f"written to {options.folder.resolve()}")


def everything() -> Iterator[tuple[Path, Asset]]:
    """Where each asset goes within the folder."""
    for name in names("vehicle"):
        yield Path("vehicles") / f"{name}.glb", assets.vehicle(load_vehicle(name))
    for name in names("module"):
        yield Path("modules") / f"{name}.glb", _module(module_alone(name))
    for name in names("map"):
        yield Path("maps") / f"{name}.glb", assets.ground(load_map(name))


def _module(alone: Map) -> Asset:
    """A box that can be pushed is no part of a map's own asset."""
    return assets.box(alone.boxes[0].size) if alone.boxes else assets.ground(alone)


if __name__ == "__main__":
    main()
