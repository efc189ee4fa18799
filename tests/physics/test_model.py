"""The digest of a Model."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from autodrive.physics.model import Model, model_digest
from autodrive.scenario import BoxSpec, ScenarioSpec, VehiclePlacement
from autodrive.world.factory import compile_scenario

BOXES = {"box": BoxSpec(x=1.0, y=0.5)}


def model_of(vehicle: str = "nigel", boxes: dict[str, BoxSpec] = BOXES) -> Model:
    return compile_scenario(ScenarioSpec(vehicles={"V1": VehiclePlacement(type=vehicle)}, boxes=boxes)).model


@pytest.mark.process
def test_the_same_scenario_has_the_same_digest_in_another_process() -> None:
    program = "from tests.physics.test_model import model_digest, model_of; print(model_digest(model_of()))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == model_digest(model_of())


def altered(value: Any) -> Iterator[Any]:
    """The value with one of its columns changed, for each of its columns that is not empty."""
    if isinstance(value, tuple):
        for name in value._fields:  # pyright: ignore[reportAttributeAccessIssue]
            for other in altered(getattr(value, name)):
                yield value._replace(**{name: other})  # pyright: ignore[reportAttributeAccessIssue]
    elif not isinstance(value, np.ndarray):
        yield value + 1
    elif value.dtype.names:
        for name in value.dtype.names:
            other = value.copy()
            other[name] = not value[name].any()
            yield other
    elif value.size:
        yield np.full_like(value, not value.any())


def test_every_column_is_part_of_the_digest() -> None:
    model = model_of()
    digests = [model_digest(model), *map(model_digest, altered(model))]
    assert len(digests) > 40  # columns
    assert len(set(digests)) == len(digests)


def test_bytes_between_the_columns_are_not_part_of_the_digest() -> None:
    model = model_of()
    padded = model.vehicles.copy()
    raw = padded.view(np.uint8).reshape(len(padded), -1)
    used = np.zeros(raw.shape[1], bool)
    for column, offset, *_ in (padded.dtype.fields or {}).values():
        used[offset : offset + column.itemsize] = True
    assert not used.all()
    raw[:, ~used] = 255
    assert model_digest(model._replace(vehicles=padded)) == model_digest(model)
