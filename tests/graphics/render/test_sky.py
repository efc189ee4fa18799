"""The sky in the images of the cameras: the sun where it is, a warm horizon below it, clouds, stars."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from autodrive.graphics.assets.asset import Asset
from autodrive.graphics.assets.textures import texture
from autodrive.graphics.cameras.viewpoints import orbit
from autodrive.graphics.render.look import NIGHT, air_of, look_at, sun_at
from autodrive.graphics.render.renderer import Renderer
from autodrive.graphics.render.scene import RenderScene
from autodrive.physics.sensors.camera.view import View
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import Weather
from tests.support.scenes import CAR, ground, lights, needs_gl, node, pinhole, render_state, view

pytestmark = needs_gl

HOUR = 3600.0
EMPTY = RenderScene(Asset("static", (), {"clouds": texture("clouds")}), [], [], [])


def seen(look: View, *, time_of_day: float = 12 * HOUR, weather: Weather | None = None) -> np.ndarray:
    """RGB of a view of the sky."""
    state = render_state(is_day=sun_at(time_of_day)[2] > 1e-9)
    state.header["time_of_day"] = time_of_day
    if weather is not None:
        state.header["air"] = air_of(weather)
    with Renderer(EMPTY, "software") as renderer:
        return renderer.draw(state, [look])[0].rgba[..., :3].astype(float)


def towards(direction: tuple[float, float, float], fov_deg: float = 60.0, size: tuple[int, int] = (240, 240)) -> View:
    """A view with that direction in its middle."""
    x, y, z = direction
    azimuth, elevation = np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))
    return orbit((0.0, 0.0, 0.0), 1.0, azimuth + 180.0, -elevation, fov_deg).view(*size)


@pytest.mark.parametrize("hour", [8, 12, 16])
def test_the_sun_is_where_it_is(hour: int) -> None:
    image = seen(towards(sun_at(hour * HOUR)), time_of_day=hour * HOUR).min(axis=2)
    bright = np.argwhere(image >= image.max() - 1.0)
    assert bright.mean(0) == pytest.approx([119.5, 119.5], abs=6.0)  # thin clouds veil a part of the halo
    assert image[120, 120] > image[:20].mean() + 40.0


def test_the_horizon_below_a_low_sun_is_warm_and_that_of_noon_is_not() -> None:
    for hour, is_warm in ((17.8, True), (18.1, True), (12.0, False)):
        x, y, _ = sun_at(hour * HOUR)
        red, _, blue = seen(towards((x, y, 0.05)), time_of_day=hour * HOUR)[110:118].mean((0, 1))
        assert bool(red > blue + 15.0) is is_warm, hour
        opposite = seen(towards((-x, -y, 0.05)), time_of_day=hour * HOUR)[110:118].mean((0, 1))
        assert not is_warm or red - blue > opposite[0] - opposite[2] + 10.0


def test_the_dusk_ends_in_the_night() -> None:
    assert look_at(18.25 * HOUR).dawn[0] > 0.1
    assert look_at(20 * HOUR) is NIGHT
    assert look_at(18.25 * HOUR).sun_color == NIGHT.sun_color


def test_more_clouds_hide_more_of_the_sky() -> None:
    look = view(0.0, 0.0, 1.0, yaw_deg=-60.0, pitch_deg=-40.0)
    blue = [
        (image[..., 2] - image[..., 0] > 25.0).mean()
        for image in (seen(look, weather=Weather(clouds=clouds)) for clouds in (0.0, 0.4, 0.7, 1.0))
    ]
    assert blue == sorted(blue, reverse=True)
    assert blue[0] > 0.6
    assert blue[3] < 0.05


def test_stars_are_small_and_clouds_hide_them() -> None:
    look = view(0.0, 0.0, 1.0, pitch_deg=-50.0, own=pinhole(320, 240, 50.0))
    clear = seen(look, time_of_day=0.0).max(axis=2)
    is_star = clear > np.median(clear) + 25.0
    assert 15 < is_star.sum() < 0.02 * is_star.size
    dull = seen(look, time_of_day=0.0, weather=Weather(clouds=1.0)).max(axis=2)
    assert (dull > np.median(dull) + 60.0).sum() == 0


@pytest.mark.parametrize("hour", [12.0, 17.6])
def test_a_sky_of_fewer_pixels_looks_the_same(hour: float) -> None:
    look = towards(sun_at(hour * HOUR), size=(480, 360))
    images = []
    for step in (1, 4):
        state = render_state()
        state.header["time_of_day"] = hour * HOUR
        with Renderer(EMPTY, "software") as renderer:
            renderer.quality = replace(renderer.quality, sky_step=step)
            images.append(renderer.draw(state, [look])[0].rgba[..., :3].astype(float))
    off = np.abs(images[1] - images[0])
    assert 0.0 < off.mean() < 0.6  # most differ by rounding
    assert off[:, [0, -1]].max() <= 6.0
    assert off[[0, -1]].max() <= 6.0


def test_the_sky_is_the_same_in_another_renderer_and_moves_only_with_the_wind() -> None:
    look = view(0.0, 0.0, 1.0, pitch_deg=-40.0)
    images = []
    for wind, time in ((0.0, 1.0), (0.0, 9.0), (0.5, 1.0), (0.5, 9.0)):
        state = render_state()
        state.header["air"], state.header["time"] = air_of(Weather(clouds=0.5, wind=wind)), time
        with Renderer(EMPTY, "software") as renderer:
            images.append(renderer.draw(state, [look])[0].rgba.tobytes())
    assert images[0] == images[1]
    assert images[2] != images[3]


def test_headlights_light_snow_in_the_air_and_fog() -> None:
    world = Asset("static", (node("floor", ground(-20, -20, 20, 20), casts=False),), EMPTY.static.textures)
    scene = RenderScene(world, [CAR], [], [lights()])
    look = view(0.1, 0.0, 0.15, pitch_deg=-12.0)  # above the ground
    with Renderer(scene, "software") as renderer:
        for weather in (Weather(snow=1.0, snow_cover=0.0), Weather(fog=0.8)):
            means = []
            for level in (0.0, 1.0):
                state = render_state(1, is_day=False)
                state.header["air"] = air_of(weather)
                state.vehicles["lamps"][:, :4] = level
                means.append(renderer.draw(state, [look])[0].rgba[..., :3].astype(float)[120:].mean())
            assert means[1] > means[0] + 3.0


@pytest.mark.parametrize("weather", [Weather(), Weather(clouds=0.8), Weather(fog=0.3)])
@pytest.mark.parametrize("hour", [6.5, 12.0, 17.7, 18.2, 23.0])
def test_ground_beyond_what_was_placed_fades_into_the_horizon(hour: float, weather: Weather) -> None:
    """No edge between ground and sky, whatever the light; the ground of the map keeps its own colour."""
    floor = node("floor", ground(-250, -250, 250, 250), casts=False)
    looks = [view(0.0, 0.0, 0.15, yaw_deg=float(yaw), own=pinhole(80, 480, 30.0)) for yaw in range(0, 360, 60)]
    state = render_state(is_day=sun_at(hour * HOUR)[2] > 1e-9)
    state.header["time_of_day"], state.header["air"] = hour * HOUR, air_of(weather)
    images = {}
    for extent in ((-3.0, -3.0, 3.0, 3.0), None):
        world = Asset("static", (floor,), EMPTY.static.textures, extent=extent)
        with Renderer(RenderScene(world, [], [], []), "software") as renderer:
            images[extent] = [image.rgba[..., :3].astype(float).mean(1) for image in renderer.draw(state, looks)]
    faded, plain = images.values()
    for rows, before in zip(faded, plain, strict=True):
        # 3 levels between rows that are 2 pixels apart at the horizon: half of it is the change of the sky
        assert np.abs(rows[238] - rows[242]).max() < 3.0
        assert rows[-1] == pytest.approx(before[-1])  # within 1 m
    if hour < 18.0 and not weather.fog:
        assert max(np.abs(rows[238] - rows[242]).max() for rows in plain) > 10.0


def test_light_in_fog_begins_beyond_the_body_of_the_car() -> None:
    """Seen from behind, headlights light the fog beside the car and beyond it, and nothing before its body."""
    world = Asset("static", (node("floor", ground(-20, -20, 20, 20), casts=False),), EMPTY.static.textures)
    look = view(-0.6, 0.0, 0.2, pitch_deg=10.0)
    images = []
    with Renderer(RenderScene(world, [CAR], [], [lights()]), "software") as renderer:
        for level in (0.0, 1.0):
            state = render_state(1, is_day=False)
            state.header["air"] = air_of(Weather(fog=0.6))
            state.vehicles["lamps"][:, :4] = level
            images.append(renderer.draw(state, [look], labels=True)[0])
    brighter = images[1].rgba[..., :3].astype(float).mean(-1) - images[0].rgba[..., :3].astype(float).mean(-1)
    is_body = images[0].labels == Label.VEHICLE
    assert is_body.sum() > 500
    assert np.abs(brighter[is_body]).max() < 3.0
    assert brighter[~is_body].max() > 30.0
