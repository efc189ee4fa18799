"""Imperfections of lens, shutter and sensor, compared with closed forms and statistics of the model."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from autodrive.base.transforms import inverse, rotate
from autodrive.graphics.render.render_state import VEHICLE
from autodrive.physics.sensors.camera import project, rays
from autodrive.physics.sensors.camera.camera import Camera, CameraSpec
from autodrive.physics.sensors.camera.imperfections import PRESETS
from autodrive.physics.sensors.camera.view import RenderedImage, View
from autodrive.physics.sensors.sensor import Mount
from autodrive.protocol.messages import CameraImage

WIDTH, HEIGHT = 96, 72


def camera(name: str = "front", mount: Mount | None = None, depth: bool = False, **imperfections: Any) -> Camera:
    spec = CameraSpec(
        mount=mount or Mount(),
        width=WIDTH,
        height=HEIGHT,
        field_of_view_deg=41.669,
        depth=depth,
        labels=depth,
        imperfections=imperfections,  # pyright: ignore[reportArgumentType]
    )
    return Camera(spec, vehicle="V1", name=name, substep=Fraction(1, 1000))


def row(**fields: Any) -> np.void:
    vehicle = np.zeros(1, VEHICLE)[0]
    vehicle["orientation"] = (1.0, 0.0, 0.0, 0.0)
    for name, value in fields.items():
        vehicle[name] = value
    return vehicle


def flat(value: int, view: View | None = None) -> RenderedImage:
    """A rendered image with one grey value."""
    k = view.intrinsics if view else None
    rgba = np.full((k.height if k else HEIGHT, k.width if k else WIDTH, 4), value, np.uint8)
    rgba[..., 3] = 255
    return RenderedImage(rgba)


def light(values: Any) -> Any:
    """Linear light of sRGB values (IEC 61966-2-1)."""
    v = np.asarray(values) / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def take(one: Camera, pictures: list[RenderedImage], vehicle: np.void | None = None) -> CameraImage:
    return one.image_from(pictures, row() if vehicle is None else vehicle, 0)


# -- sensor -----------------------------------------------------------------------------------------------------


def test_conversion_to_light_and_back_keeps_every_grey_value() -> None:
    one = camera(vignetting=1e-12)  # not ideal, so that values are converted to light and back
    for value in range(256):
        assert (take(one, [flat(value)]).rgb == value).all()


def test_exposure_is_in_stops_and_saturates() -> None:
    brighter = take(camera(exposure=1.0), [flat(100)]).rgb[0, 0, 0]
    assert light(brighter) == pytest.approx(2.0 * light(100), rel=0.01)
    assert (take(camera(exposure=3.0), [flat(200)]).rgb == 255).all()  # saturated


def test_vignetting_follows_the_cos4_law() -> None:
    one = camera(vignetting=1.0)
    seen = light(take(one, [flat(230)]).rgb[..., 0])
    axis = rays(one.intrinsics)[..., 2]  # cosine of the angle
    np.testing.assert_allclose(seen, light(230) * axis**4, atol=0.004)
    half = math.atan(math.hypot(WIDTH, HEIGHT) / HEIGHT * math.tan(math.radians(41.669 / 2)))
    assert seen[0, 0] / seen[36, 48] == pytest.approx(math.cos(half) ** 4, abs=0.015)


@pytest.mark.parametrize("value", [60, 120, 200])
def test_noise_follows_the_photon_transfer_curve(value: int) -> None:
    """Variance in electrons = electrons + read noise^2."""
    white, read = 2000.0, 12.0
    one = camera(white_electrons=white, read_noise=read)
    frames = [take(one, [flat(value)]).rgb for _ in range(12)]
    electrons = white * light(np.stack(frames))
    expected = white * light(value)
    assert electrons.mean() == pytest.approx(expected, rel=0.01)
    step = white * float(light(value + 1) - light(value))  # electrons per sRGB value; rounding adds step^2/12
    assert electrons.var() == pytest.approx(expected + read**2 + step**2 / 12.0, rel=0.04)
    # the noise of pixels, colours and images is independent
    deviations = electrons - electrons.mean()
    for shifted in (deviations[:, :, 1:] * deviations[:, :, :-1], deviations[1:] * deviations[:-1]):
        assert abs(shifted.mean()) < 0.03 * electrons.var()


def test_noise_depends_on_seed_and_camera_and_can_be_restored() -> None:
    def picture(one: Camera) -> bytes:
        return take(one, [flat(128)]).rgba.tobytes()

    front, rear = (camera(name, white_electrons=1000.0) for name in ("front", "rear"))
    front.reset(1)
    first, second = picture(front), picture(front)
    assert first != second
    front.reset(1)
    saved = front.save()
    assert [picture(front), picture(front)] == [first, second]
    front.restore(saved)
    assert picture(front) == first
    front.reset(2)
    assert picture(front) != first
    rear.reset(1)
    assert picture(rear) != first


# -- shutter ----------------------------------------------------------------------------------------------------


def test_views_of_a_slow_shutter_follow_the_motion_of_the_camera() -> None:
    one = camera(mount=Mount(position=(0.2, 0.0, 0.1)), exposure_time=0.02, exposures=5)
    vehicle = row(position=(1.0, 2.0, 0.0), velocity=(3.0, 0.0, 0.0))
    places = [view.position for view in one.views(vehicle, 0.0)]
    np.testing.assert_allclose(places, [(1.2 + 3.0 * t, 2.0, 0.1) for t in (-0.01, -0.005, 0.0, 0.005, 0.01)])
    turning = row(angular_velocity=(0.0, 0.0, 2.0))
    ahead = [rotate(view.orientation, (0.0, 0.0, 1.0)) for view in one.views(turning, 0.0)]
    np.testing.assert_allclose([math.atan2(y, x) for x, y, _ in ahead], [-0.02, -0.01, 0.0, 0.01, 0.02], atol=1e-12)
    image = take(one, [flat(0)] * 5, vehicle)
    np.testing.assert_allclose(image.pose.position, (1.2, 2.0, 0.1))


def test_motion_blur_is_the_mean_of_light() -> None:
    one = camera(exposure_time=0.01, exposures=3)
    seen = take(one, [flat(0), flat(255), flat(0)]).rgb
    # the hat function of the middle image covers half of the exposure
    assert light(seen).mean() == pytest.approx(0.5, abs=0.005)


def test_rolling_shutter_exposes_rows_in_sequence() -> None:
    one = camera(readout_time=0.02, exposures=5)
    # brightness increases with time, so that each row shows its time
    times = np.linspace(-0.01, 0.01, 5)
    values = [1.0 + 60.0 * (t + 0.01) for t in times]  # linear light in units of 0.3
    pictures = [flat(int(np.argmin(abs(light(np.arange(256)) - 0.3 * v)))) for v in values]
    true = [float(light(p.rgba[0, 0, 0])) for p in pictures]
    seen = light(take(one, pictures).rgb[:, 0, 0])
    rows = 0.02 * ((np.arange(HEIGHT) + 0.5) / HEIGHT - 0.5)
    np.testing.assert_allclose(seen, np.interp(rows, times, true), atol=0.004)
    assert seen[0] < seen[-1]


def test_weights_of_each_row_add_up_to_one() -> None:
    for exposure, readout in [(0.005, 0.0152), (0.0, 0.01), (0.01, 0.0), (1e-6, 0.02), (0.02, 1e-6)]:
        one = camera(exposure_time=exposure, readout_time=readout, exposures=7)
        assert (take(one, [flat(150)] * 7).rgb == 150).all()


# -- lens -------------------------------------------------------------------------------------------------------


def test_distorted_images_agree_with_project() -> None:
    one = camera(distortion=(-0.3, 0.1, 0.004, -0.003, 0.0), depth=True)
    (view,) = one.views(row(), 0.0)
    ideal = view.intrinsics
    assert ideal.width > WIDTH
    for point in ([0.3, 0.2, 1.0], [-0.4, 0.05, 1.0], [0.0, -0.3, 1.0], [0.45, 0.33, 1.0]):
        u, v = project(ideal, np.array([point]))[0]
        # a Gaussian spot at that pixel of the ideal image
        x, y = np.meshgrid(np.arange(ideal.width) + 0.5, np.arange(ideal.height) + 0.5)
        spot = np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * 2.0**2))
        rgba = np.zeros((ideal.height, ideal.width, 4), np.uint8)
        rgba[..., :3] = np.round(255 * spot)[..., None]
        labels = (spot > 0.5).astype(np.uint8)
        image = take(one, [RenderedImage(rgba, np.where(labels, 1.0, np.inf).astype(np.float32), labels)])
        expected = project(one.intrinsics, np.array([point]))[0]
        for weight in (light(image.rgb[..., 0]), image.labels):
            assert weight is not None
            across, down = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
            centre = np.array([(across * weight).sum(), (down * weight).sum()]) / weight.sum()
            np.testing.assert_allclose(centre, expected, atol=0.35)
        assert image.depth is not None
        assert image.labels is not None
        np.testing.assert_array_equal(np.isfinite(image.depth), image.labels == 1)


def test_distortion_leaves_no_dark_corner() -> None:
    for preset in PRESETS.values():
        for k1 in (preset.distortion, (-0.35, 0.1, 0.0, 0.0, 0.0)):
            one = camera(distortion=k1)
            (view,) = one.views(row(), 0.0)
            assert (take(one, [flat(77, view)]).rgb == 77).all()


# -- presets ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(PRESETS))
def test_a_realistic_camera_has_the_imperfections_of_its_hardware(name: Any) -> None:
    spec = camera().spec.model_copy(update={"hardware": name})
    assert spec.realistic().imperfections == PRESETS[name]
    written = CameraSpec.model_validate({**spec.model_dump(), "imperfections": name})
    assert written.imperfections == PRESETS[name]


def test_an_image_of_a_realistic_camera_has_the_size_and_brightness_of_the_ideal_one() -> None:
    one = Camera(camera().spec.realistic(), vehicle="V1", name="front", substep=Fraction(1, 1000))
    vehicle = row(velocity=(0.26, 0.0, 0.0), angular_velocity=(0.0, 0.0, 1.0))
    views = one.views(vehicle, 0.0)
    assert len(views) == 5
    ahead = rotate(inverse(views[2].orientation), (1.0, 0.0, 0.0))
    np.testing.assert_allclose(ahead, (0.0, 0.0, 1.0), atol=1e-12)
    image = take(one, [flat(128, view) for view in views], vehicle)
    assert image.rgba.shape == (HEIGHT, WIDTH, 4)
    assert (image.rgba[..., 3] == 255).all()
    assert light(image.rgb[30:42, 40:56]).mean() == pytest.approx(float(light(128)), rel=0.02)
