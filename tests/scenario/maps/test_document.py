"""The page on scenarios names every key that the file of a map can have."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest

from autodrive.base.specs import Spec
from autodrive.scenario.maps.light_programs import LightPhase, LightProgramSpec
from autodrive.scenario.maps.props import PropKind, PropSpec
from autodrive.scenario.maps.shapes import Arc, Line, Polygon, Rectangle, Sector
from autodrive.scenario.maps.solids import BlockSpec, WallSpec
from autodrive.scenario.maps.spec import GroundSpec, MapSpec, Placement

PAGE = (Path(__file__).parents[3] / "docs" / "scenarios.md").read_text(encoding="utf-8")
ROWS = dict(re.findall(r"^\| `(\w+)[^|]*\| (.*) \|$", PAGE.partition("### Keys of a map")[2], re.MULTILINE))
SPECS: dict[str, tuple[type[Spec], ...]] = {
    "ground": (GroundSpec,),
    "placements": (Placement,),
    "walls": (WallSpec,),
    "blocks": (BlockSpec,),
    "props": (PropSpec,),
    "light_programs": (LightProgramSpec, LightPhase),
    "rectangle": (Rectangle,),
    "sector": (Sector,),
    "polygon": (Polygon,),
    "line": (Line,),
    "arc": (Arc,),
}


@pytest.mark.parametrize("row", SPECS)
def test_a_row_of_the_table_has_all_keys(row: str) -> None:
    named = set(re.findall(r"`(\w+)(?:: [^`]*)?`", ROWS[row]))
    assert {key for spec in SPECS[row] for key in spec.model_fields} - {"shape"} <= named
    for spec in SPECS[row]:
        for key, field in spec.model_fields.items():
            if key != "shape" and (given := re.search(rf"`{key}: ([^`\[]+)`", ROWS[row])):
                default = field.default
                assert not field.is_required()
                assert given[1] == str(default).lower() or float(given[1]) == default


def test_the_table_has_all_keys_of_a_map_and_all_kinds_of_signs() -> None:
    text = PAGE.partition("### Keys of a map")[2]
    assert set(re.findall(r"`(\w+)", "".join(re.findall(r"^\| (`[^|]*)\|", text, re.MULTILINE)))) >= {
        *MapSpec.model_fields
    }
    kinds = {kind for part in get_args(PropKind) for kind in get_args(part)}
    assert kinds <= set(re.findall(r"`(\w+)`", ROWS["props"]))
