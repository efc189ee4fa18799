"""Values that every entrance of the simulator refuses, by the kind of value that it wants."""

from __future__ import annotations

import math
from typing import Any

NOT_FINITE = (math.nan, math.inf, -math.inf)
WRONG_TYPES = ("fast", (), [0.5], {}, b"x")

INVALID: dict[str, tuple[Any, ...]] = {
    "command": (*NOT_FINITE, *WRONG_TYPES),
    "length": (*NOT_FINITE, *WRONG_TYPES, 1e10, -1e300),
    "speed": (*NOT_FINITE, *WRONG_TYPES, 0.0, -1.0, 1e-12),
    "seed": (*NOT_FINITE, *WRONG_TYPES, -1, 2**63, 0.5),
    "vehicle": ("V9", "v1", "", "V1\0", "x" * 1000),
    "lamp": (-1, 7, *WRONG_TYPES),
    "ticks": (0, -1, *WRONG_TYPES),
    "commands": ((0.5, 0), 0.5, "V1", {"V1": (0.5, 0)}, {"V1": 3}, {"V1": None}),
}
