"""Variants of the tasks of several cars: the published benchmark, and one that is better posed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, TypeAlias, get_args

import numpy as np

from autodrive.base.arrays import Floats
from autodrive.base.errors import SpecError
from autodrive.base.suggest import suggest
from autodrive.experiments.envs.settings import Action

Variant: TypeAlias = Literal["published", "own"]


def is_published(variant: Variant) -> bool:
    """Whether it is the published one. Raises `SpecError` for another word."""
    if variant not in get_args(Variant):
        raise SpecError([f"variant: {variant!r} is not known. {suggest(str(variant), [*get_args(Variant)])}"])
    return variant == "published"


def action_of(variant: Variant, action: Action | None) -> Action:
    """The kind of action; None: that of the variant. Raises `SpecError`: the published actions are discrete."""
    if is_published(variant) and action == "continuous":
        raise SpecError(["action: the actions of the variant 'published' are discrete; choose the variant 'own'"])
    return action or ("discrete" if is_published(variant) else "continuous")


def choices(throttles: Sequence[float]) -> Floats:
    """The published actions, throttle and steering: action 3 i + j has the i-th throttle, and left, 0 or right."""
    return np.array([(throttle, steering) for throttle in throttles for steering in (1.0, 0.0, -1.0)])
