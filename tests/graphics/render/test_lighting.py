"""Which lamps can light something in a view."""

from __future__ import annotations

import numpy as np

from autodrive.graphics.render.lighting import LAMP, lights_view
from autodrive.graphics.render.renderer import clip_from_optical
from autodrive.graphics.render.scene import rigid
from tests.support.scenes import view


def test_a_lamp_that_lights_a_place_in_sight_is_kept_and_most_others_are_left_out() -> None:
    rng = np.random.default_rng(1)
    wrong = kept = left_out = 0
    for _ in range(40):
        x, y = rng.uniform(-1, 1, 2)
        look = view(x, y, 0.2, yaw_deg=rng.uniform(-180, 180), pitch_deg=rng.uniform(-30, 30))
        clip = clip_from_optical(look) @ np.linalg.inv(rigid(look.position, look.orientation))
        lamps = np.zeros(60, LAMP)
        lamps["place"] = rng.uniform(-1.5, 1.5, (60, 3)) * (1.0, 1.0, 0.1)
        aim = rng.normal(size=(60, 3)) * (1.0, 1.0, 0.2)
        lamps["aim"] = aim / np.linalg.norm(aim, axis=1)[:, None]
        lamps["range"], lamps["cos_outer"] = rng.uniform(0.2, 1.0, 60), rng.uniform(0.05, 0.9, 60)
        found = lights_view(lamps, clip, np.array(look.position))
        points = rng.uniform(-2.5, 2.5, (20_000, 3)) * (1.0, 1.0, 0.3)
        x, y, z, w = clip @ np.column_stack([points, np.ones(len(points))]).T
        points = points[(np.abs(x) < w) & (np.abs(y) < w) & (np.abs(z) < w)]
        for lamp, is_found in zip(lamps, found, strict=True):
            to = points - lamp["place"]
            far = np.linalg.norm(to, axis=1)
            is_lit = np.any((far < lamp["range"]) & (to @ lamp["aim"] > lamp["cos_outer"] * far))
            wrong += bool(is_lit and not is_found)
            kept += bool(is_found)
            left_out += not is_found
    assert wrong == 0
    assert left_out > kept
