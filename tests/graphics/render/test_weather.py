"""Weather in the images of the cameras: fog by depth, wet and white ground, streaks, dim sun."""

from __future__ import annotations

import math

import numpy as np
import pytest

from autodrive.graphics.render.look import DAY, air_of, in_air
from autodrive.graphics.render.render_state import RenderState
from autodrive.graphics.render.renderer import Renderer
from autodrive.physics.weather import ChangingWeather, extinction
from autodrive.protocol.labels import Label
from autodrive.protocol.messages import CameraIntrinsics, Weather
from autodrive.protocol.weather import PRESETS
from tests.support.scenes import GREY, box, ground, needs_gl, node, render_state, scene, view

pytestmark = needs_gl

WALLS = [
    node(f"wall_{n}", box((x, 1.5 - n, 0.5), (0.2, 0.9, 1.0), GREY, Label.WALL)) for n, x in enumerate((2.0, 4.0, 8.0))
]
SCENE = scene(node("floor", ground(-20, -20, 20, 20)), *WALLS, vehicles=1)
LOOK = view(0.0, 0.0, 0.15, pitch_deg=3.0)


@pytest.fixture(scope="module")
def renderer() -> Renderer:
    return Renderer(SCENE, "software")


def in_weather(weather: Weather, time: float = 1.0) -> RenderState:
    state = render_state(1)
    state.vehicles["position"][0] = 0.0, -5.0, 0.0
    state.header["time"] = time
    state.header["air"] = air_of(ChangingWeather.settled(weather).at(0.0))
    return state


def image(renderer: Renderer, weather: Weather, time: float = 1.0) -> np.ndarray:
    return renderer.draw(in_weather(weather, time), [LOOK])[0].rgba[..., :3].astype(np.float64)


@pytest.mark.parametrize("name", PRESETS)
def test_depth_and_labels_do_not_see_the_weather(renderer: Renderer, name: str) -> None:
    clear, seen = (
        renderer.draw(in_weather(one), [LOOK], depth=True, labels=True)[0] for one in (Weather(), PRESETS[name])
    )
    assert clear.depth is not None
    assert seen.depth is not None
    assert clear.labels is not None
    assert seen.labels is not None
    assert clear.depth.tobytes() == seen.depth.tobytes()
    assert clear.labels.tobytes() == seen.labels.tobytes()
    assert (clear.rgba.tobytes() == seen.rgba.tobytes()) == (name == "sunny")


def test_fog_hides_by_distance_what_the_sight_says(renderer: Renderer) -> None:
    """The difference to the horizon falls as exp(-extinction * distance), in linear light."""
    fog = Weather(fog=0.9)
    thin, thick = image(renderer, Weather(fog=0.05)), image(renderer, fog)
    depth = renderer.draw(in_weather(fog), [LOOK], depth=True)[0].depth
    assert depth is not None
    horizon = linear(thick[0].mean(axis=0))
    for distance in (1.9, 3.9, 7.9):
        wall = np.abs(depth - distance) < 0.02
        assert wall.sum() > 50
        contrast = np.abs(linear(thick[wall]) - horizon).mean() / np.abs(linear(thin[wall]) - horizon).mean()
        # 25 %: a pixel has 256 levels, the clouds of the denser fog dim the sun, and walls at the side are farther
        assert contrast == pytest.approx(math.exp(-extinction(fog) * distance), rel=0.25, abs=0.06)


def linear(shown: np.ndarray) -> np.ndarray:
    return (shown / 255.0) ** 2.2


def test_wet_ground_is_darker_near_by_and_snow_whitens_level_surfaces_only(renderer: Renderer) -> None:
    grounds = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    dry, wet, white = (image(renderer, Weather(clouds=1.0, wetness=w, snow_cover=s)) for w, s in grounds)
    near = np.s_[-20:, 100:220]
    assert wet[near].mean() < 0.85 * dry[near].mean()
    assert white[near].mean() > 1.15 * dry[near].mean()
    labels = renderer.draw(in_weather(Weather()), [LOOK], labels=True)[0].labels
    assert labels is not None
    wall = labels == Label.WALL
    assert wall.sum() > 5000
    # at most a tenth is whiter: images have the mean colour of a pixel at an edge, labels that of its centre;
    # all may be darker, because a camera exposes snow for a shorter time
    assert ((white[wall] - dry[wall]).max(axis=1) > 3.0).mean() < 0.1


def test_no_snow_lies_on_vehicles_and_they_are_not_wet(renderer: Renderer) -> None:
    """The patches of snow are those of the ground: on a vehicle that drives, they would move. The page has the same."""

    def car(**ground: float) -> np.ndarray:
        state = in_weather(Weather(clouds=1.0, **ground))
        state.vehicles["position"][0] = 0.8, 0.0, 0.0
        look = view(0.0, 0.0, 0.6, pitch_deg=35.0)
        seen = renderer.draw(state, [look], labels=True)[0]
        assert seen.labels is not None
        inside = seen.labels == Label.VEHICLE
        assert inside.sum() > 1000
        return seen.rgba[inside][:, :3].astype(np.float64)

    dry = car(wetness=0.0)
    assert np.array_equal(car(wetness=1.0), dry)
    assert (car(snow_cover=1.0).mean(axis=1) > dry.mean(axis=1) + 3.0).mean() < 0.1  # edges, as above


def test_patches_of_snow_do_not_sparkle_far_away() -> None:
    """A pixel that covers many patches has their mean, as that of an image with 64 samples for each pixel."""
    open_ground = Renderer(scene(node("floor", ground(-300, -300, 300, 300)), vehicles=1), "software")
    melting, width, height = Weather(clouds=1.0, snow_cover=0.5), 320, 180

    def shades(n: int) -> np.ndarray:
        pinhole = CameraIntrinsics(n * width, n * height, 160.0 * n, 160.0 * n, 0.5 * n * width, 0.5 * n * height)
        drawn = open_ground.draw(in_weather(melting), [view(0.0, 0.0, 0.3, own=pinhole)])[0]
        return drawn.rgba[..., :3].astype(np.float64).mean(axis=2)

    once, fine = shades(1), shades(8)
    samples = fine.reshape(height, 8, width, 8).mean(axis=(1, 3))
    far = np.s_[height // 2 + 2 : height // 2 + 8]  # 8 to 40 m away
    assert np.abs(once[far] - samples[far]).max() < 25.0  # of 255; white is 50 brighter than the ground
    near = np.s_[-40:]
    assert once[near].max() - once[near].min() > 40.0  # there are patches


def test_rain_and_snow_are_in_front_of_the_scene_and_change_with_time(renderer: Renderer) -> None:
    calm = image(renderer, Weather(clouds=1.0, wetness=1.0))
    for weather in (Weather(clouds=1.0, rain=1.0), Weather(clouds=1.0, snow=1.0, snow_cover=0.0)):
        first, again, later = (image(renderer, weather, time) for time in (1.0, 1.0, 1.1))
        assert first.tobytes() == again.tobytes()
        changed = np.abs(first - later).max(axis=2) > 8
        assert 0.005 < changed.mean() < 0.25
        assert changed[:80].any()
        assert changed[-80:].any()
    assert np.abs(calm - image(renderer, Weather(clouds=1.0, wetness=1.0), 2.0)).max() == 0.0


@pytest.mark.parametrize("weather", [Weather(rain=1.0), Weather(snow=1.0)])
def test_rain_and_snow_never_darken_what_headlamps_light(renderer: Renderer, weather: Weather) -> None:
    """Few pixels of an image show a drop or a flake: the median of many images is the scene without them."""
    state = in_weather(weather)
    state.header["is_day"] = False
    state.vehicles["position"][0] = 0.0
    state.vehicles["lamps"] = 1.0
    images = []
    for time in range(0, 125, 5):  # a drop stays on the lens for 4 s
        state.header["time"] = time
        images.append(renderer.draw(state, [LOOK])[0].rgba[..., :3].astype(np.float64))
    behind = np.median(images, axis=0)
    assert behind.max() > 100.0  # bright ground or wall
    assert (np.array(images) - behind).min() >= -1.0
    assert (np.array(images) - behind).max() > 10.0


def test_clouds_dim_the_sun_and_fade_shadows() -> None:
    clear, dull = DAY, in_air(DAY, air_of(Weather(clouds=1.0)))
    assert max(dull.sun_color) < 0.1 * max(clear.sun_color)
    assert max(dull.zenith) == pytest.approx(min(dull.zenith))  # grey
    assert in_air(DAY, air_of(Weather())) == DAY
