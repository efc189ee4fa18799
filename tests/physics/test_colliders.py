"""Colliders of wheels against the exact overlap of two cylinders."""

import pytest

from autodrive.physics.engine import Engine
from autodrive.scenario.maps.map import load_map
from autodrive.scenario.maps.mjcf import text, world_mjcf
from autodrive.scenario.maps.solids import fixed_shapes

Numbers = tuple[float, ...]

GRAZING: dict[str, tuple[Numbers, Numbers, Numbers, float]] = {
    "side by side": (
        (0.0275, 0.011),
        (-0.054997934764520424, -0.0004541558658882174, -0.0032257849902862226),
        (0.9999947974375737, 0.0015327910980352068, 9.57880478901941e-06, -0.0028382314005719624),
        0.3e-6,
    ),
    "askew": (
        (0.0408, 0.0225),
        (-0.05272108883686481, -0.062249076064990236, -0.02113154255667437),
        (0.9960856080863395, 0.031171123435529184, 0.04357831976878716, -0.07030471160002835),
        0.03e-3,
    ),
    "face on tread": (
        (0.039, 0.0225),
        (-0.006296044762189728, -0.004299343279274306, 0.05996705191062207),
        (0.7032779931506531, 0.011544876884969331, 0.7108118811664708, 0.0036400220168838785),
        1.77e-3,
    ),
}
"""From jams: radius and half width of two equal wheels, pose of the second in the axes of the first (z is its axle),
and the smallest of their overlaps along any direction [m]."""


@pytest.mark.parametrize("case", GRAZING)
def test_wheels_that_graze_each_other_are_not_deep_in_each_other(case: str) -> None:
    size, position, orientation, depth = GRAZING[case]
    wheels = [
        f'<body name="{name}" pos="{text(at)}" quat="{text(turn)}"><freejoint name="{name}"/>'
        f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
        f'<geom class="wheel" size="{text(size)}" quat="1 0 0 0"/></body>'
        for name, at, turn in (
            ("one", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)),
            ("other", (position[0], position[1], position[2] + 1.0), orientation),
        )
    ]
    engine = Engine(world_mjcf(load_map("plane"), [], wheels, 0.001, 9.81), fixed_shapes([]))
    assert -engine.data.contact.dist.min() == pytest.approx(depth, rel=0.05)
