"""The command `new`: a commented file to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, TypeAlias

import typer

from autodrive.cli.options import Force, argument, check_outputs

Start: TypeAlias = Literal["vehicle", "map", "scenario", "driver"]
"""What `new` can write."""

SCENARIO = """# A scenario: a map, vehicles at their start poses, boxes. All keys: docs/scenarios.md
title: {name}
map: mini_map              # a name (autodrive list maps) or the path of a file
vehicles:
  V1: {{type: nigel, x: 0.0, y: 0.0, yaw_deg: 0.0}}      # [m], left turns positive; types: autodrive list vehicles
boxes:
  parcel: {{x: 1.2, y: 0.0, mass: 0.2}}                  # can be pushed; [m], [kg]
scene_light: true          # false: night
seed: 1                    # the noise of the sensors follows from it
"""

MAP = """# A map: modules, whose roads must meet end to end, and walls. Modules: autodrive list modules
title: {name}
placements:
  - {{module: straight_road, x: 0.0, y: 0.0, open: [west]}}    # x, y: middle of the module [m]; its road runs along x
  - {{module: curved_road, x: 0.8, y: 0.2}}                     # from the west to the north
  - {{module: dead_end, x: 1.0, y: 1.0, yaw_deg: 90}}
walls:
  - {{points: [[-1, -1], [2, -1], [2, 2], [-1, 2]], is_closed: true, height: 0.25}}
"""

DRIVER = '''"""A driver for the AutoDRIVE devkit.

Start it, then the simulator: autodrive run mini_map --devkit 127.0.0.1:4567
"""

from autodrive.devkit import Nigel, drive

nigel = Nigel("V1", is_left_positive=True)


def step():
    """Called for each message of the simulator: read the sensors of `nigel`, then set its commands."""
    nearest = nigel.lidar_range_array.min(initial=12.0)  # [m]
    nigel.throttle_command = 0.0 if nearest < 0.2 else 0.3  # -1 to 1; 0 brakes
    nigel.steering_command = 0.0  # -1 to 1, left positive


drive(step, nigel)
'''


def new(
    what: Start = argument("What to write.", ...),
    name: str = argument("Name of the file, without its end.", ...),
    force: Force = False,
) -> None:
    """Write a commented start of your own vehicle, map, scenario or driver into this folder."""
    from autodrive.base.cache import write_file
    from autodrive.scenario.kinds import find

    suffix, use = ("py", "python") if what == "driver" else ("yaml", "autodrive check")
    path = Path(f"{name.removesuffix('.yaml').removesuffix('.py')}.{suffix}")
    check_outputs(path, is_forced=force)
    texts = {"map": MAP.format(name=path.stem), "scenario": SCENARIO.format(name=path.stem), "driver": DRIVER}
    write_file(path, texts.get(what) or find("vehicle", "nigel").read_text(encoding="utf-8"))
    typer.echo(f"wrote {path}. Next:  {use} {path}")
