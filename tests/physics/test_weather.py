"""Formulas of the weather, compared with published figures and with independent solutions of the same equations."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import scipy

import autodrive
from autodrive.physics.weather import (
    REFLECTIVITY,
    SURFACES,
    ChangingWeather,
    backscatter,
    detection_range,
    extinction,
    road,
    sight,
    wet_reflectivity,
)
from autodrive.protocol.messages import Weather
from autodrive.protocol.weather import PRESETS


def test_fog_has_the_sight_at_which_five_percent_of_a_contrast_are_left() -> None:
    fog = Weather(fog=1.0)
    assert sight(fog) == pytest.approx(5.0)
    assert math.exp(-extinction(fog) * sight(fog)) == pytest.approx(0.05)  # the definition of the WMO
    assert sight(Weather(fog=0.5)) == pytest.approx(20.0)
    assert sight(Weather(clouds=1.0, wind=1.0)) == math.inf


@pytest.mark.parametrize("amount", [0.05, 0.3, 1.0])
def test_fog_takes_as_much_light_per_sight_as_others_have_found(amount: float) -> None:
    # Pierce, Ramaprasad and Eisenberg, Optical attenuation in fog and clouds, Proc. SPIE 4530, 2001: kappa / V dB/km at
    # the visual range V [km], with 8.5 dB < kappa < 17 dB, at all wavelengths from visible light to near infrared
    fog = Weather(fog=amount)
    decibels = 1e4 * extinction(fog) / math.log(10.0)
    assert 8.5 < decibels * sight(fog) / 1000.0 < 17.0


@pytest.mark.parametrize(("amount", "rate"), [(0.3, 4.5), (0.8, 32.0), (1.0, 50.0)])
def test_rain_takes_as_much_light_as_drops_of_the_published_sizes(amount: float, rate: float) -> None:
    # Marshall and Palmer, J. Meteorology 5, 1948: 8000 drops per m^3 and mm of diameter, times exp(-4.1 R^-0.21 D).
    # A drop takes twice the light that falls on its cross section (van de Hulst, Light Scattering by Small Particles).
    taken, _ = scipy.integrate.quad(
        lambda d: 2.0 * math.pi / 4.0 * (1e-3 * d) ** 2 * 8000.0 * math.exp(-4.1 * rate**-0.21 * d), 0.0, 20.0
    )
    # 35 %: rain has many distributions of sizes; the ITU's coefficients are those of one place
    assert extinction(Weather(rain=amount)) == pytest.approx(taken, rel=0.35)


def test_snow_takes_more_light_than_rain_of_the_same_rate() -> None:
    # Recommendation ITU-R P.1814, figure of dry snow: about 130 dB/km at 10 mm/h
    per_kilometre = 1e4 * extinction(Weather(snow=1.0)) / math.log(10.0)
    assert per_kilometre == pytest.approx(133.0, rel=0.02)
    assert extinction(Weather(snow=0.9)) > 5.0 * extinction(Weather(rain=0.4))


def test_extinctions_of_fog_rain_and_snow_add_up() -> None:
    parts = [extinction(one) for one in (Weather(fog=0.4), Weather(rain=0.6), Weather(snow=0.2))]
    assert extinction(Weather(fog=0.4, rain=0.6, snow=0.2)) == pytest.approx(sum(parts))


@pytest.mark.parametrize("lost", [1e-6, 0.003, 0.05, 0.6])
@pytest.mark.parametrize("reflectivity", [0.05, 0.1, 0.8])
def test_a_lidar_reaches_as_far_as_the_law_of_beer_and_lambert_says(lost: float, reflectivity: float) -> None:
    found = detection_range(reflectivity, lost, 12.0, 0.1)
    clear = 12.0 * math.sqrt(reflectivity / 0.1)
    assert found == pytest.approx(float(scipy.special.lambertw(lost * clear).real) / lost)
    power = reflectivity * math.exp(-2.0 * lost * found) / found**2
    assert power == pytest.approx(0.1 / 12.0**2)


def test_a_lidar_in_clear_air_reaches_its_maximum_range_at_its_rated_reflectivity() -> None:
    assert detection_range(0.1, 0.0, 12.0, 0.1) == pytest.approx(12.0)
    assert detection_range(0.0, 0.1, 12.0, 0.1) == 0.0


def test_range_in_fog_is_that_which_was_measured_in_a_fog_chamber() -> None:
    # Bijelic, Gruber, Ritter: A benchmark for lidar sensors in fog, IV 2018: below a sight of 40 m the Velodyne HDL-64
    # sees targets of up to 90 % at 25 m at most. Its data sheet: 120 m at a reflectivity of 80 %.
    assert detection_range(0.9, math.log(20.0) / 40.0, 120.0, 0.8) == pytest.approx(25.0, rel=0.1)


def range_of_lidar(weather: Weather, longest: float) -> float:
    """In that weather [m], of a LIDAR that sees a target of 80 % reflectivity as far as `longest` in clear air."""
    return detection_range(0.8, extinction(weather), longest, 0.8)


def range_by(decibels: float, longest: float) -> float:
    """Likewise in air that takes that many dB/km, found by a general solver of the LIDAR equation."""
    lost = decibels * math.log(10.0) / 1e4

    def excess(r: float) -> float:
        return math.exp(-2.0 * lost * r) / r**2 - 1.0 / longest**2

    return float(scipy.optimize.brentq(excess, 1e-3, longest))


LIDARS = [10.0, 30.0, 120.0]
"""Ranges [m]: of the race car, of a robot, and of a car."""


@pytest.mark.parametrize("longest", LIDARS)
@pytest.mark.parametrize("visibility", [7.0, 10.0, 20.0, 50.0, 200.0, 490.0])
def test_range_in_fog_is_that_of_the_published_curves(visibility: float, longest: float) -> None:
    # Kim, McArthur and Korevaar, Proc. SPIE 4214, 2001: below a visibility V of 0.5 km, fog takes 3.91 / V of the light
    # per km at all wavelengths, with V at a contrast of 2 %; so do Recommendation ITU-R P.1814-1, 2025 (17 / V dB/km).
    # Our sight is at 5 % (WMO).
    fog = Weather(fog=math.sqrt(5.0 / (visibility * math.log(20.0) / math.log(50.0))))
    assert range_of_lidar(fog, longest) == pytest.approx(range_by(17.0 / (visibility / 1000.0), longest), rel=0.1)


@pytest.mark.parametrize("longest", LIDARS)
@pytest.mark.parametrize("rate", [2.0, 10.0, 30.0, 50.0])
def test_range_in_rain_is_that_of_the_published_curves(rate: float, longest: float) -> None:
    # Recommendation ITU-R P.1814-1, 2025: 1.2924 R^0.6436 dB/km for drops with an exponential distribution of sizes,
    # newer than the formula of 2007 that we use. The integral over the drops is in another test above.
    rain = Weather(rain=math.sqrt(rate / 50.0))
    assert range_of_lidar(rain, longest) == pytest.approx(range_by(1.2924 * rate**0.6436, longest), rel=0.1)
    assert range_of_lidar(rain, longest) < longest


@pytest.mark.parametrize("rate", [2.0, 10.0, 30.0, 50.0])
def test_the_law_of_range_against_extinction_is_the_published_one(rate: float) -> None:
    # Goodin and others, Electronics 8, 2019, 89: threshold 0.9 / (pi R_max^2), and an extinction of 0.01 R^0.6. Only
    # the law is compared: per metre, that extinction is 30 times that of the ITU, and of drops of the published sizes.
    lost, longest = 0.01 * rate**0.6, 100.0
    root = scipy.optimize.brentq(
        lambda z: 0.9 / math.pi / z**2 * math.exp(-2.0 * lost * z) - 0.9 / (math.pi * longest**2), 0.1, longest
    )
    assert detection_range(0.9, lost, longest, 0.9) == pytest.approx(root, rel=1e-6)


def test_wet_surfaces_are_darker_as_measured() -> None:
    # Lekner and Dorf 1988, figure 3: a dry albedo of 0.3 becomes about 0.18, of 0.8 about 0.7
    assert wet_reflectivity(0.3) == pytest.approx(0.18, abs=0.02)
    assert wet_reflectivity(0.8) == pytest.approx(0.68, abs=0.03)
    assert wet_reflectivity(1.0) == pytest.approx(0.98)
    assert all(wet_reflectivity(one) < one for one in REFLECTIVITY.values())


def test_air_sends_back_more_the_denser_the_fog_is() -> None:
    # Hahner and others 2021 (5), with a pulse that is short against the distance: beta L exp(-2 a R2) against
    # rho / pi exp(-2 a R2)
    lost = math.log(20.0) / 50.0
    assert backscatter(lost) == pytest.approx(math.pi * 0.046 / 50.0 * 0.75 * math.exp(-2.0 * lost))
    assert backscatter(0.0) == 0.0


def test_friction_on_wet_and_white_roads_is_that_of_the_literature() -> None:
    # Wong, Theory of Ground Vehicles, table 1.3: asphalt dry 0.8 to 0.9, wet 0.5 to 0.7; packed snow 0.2
    wet = road(SURFACES["asphalt"], Weather(wetness=1.0))
    white = road(SURFACES["asphalt"], Weather(snow_cover=1.0))
    assert 0.5 <= 0.85 * wet.grip <= 0.7
    assert 0.85 * white.grip == pytest.approx(0.2)
    assert (wet.resistance, road(SURFACES["asphalt"], Weather())) == (0.0, (1.0, 0.0))
    assert white.resistance > 0.0


def test_the_ground_becomes_wet_faster_than_it_dries() -> None:
    shower = ChangingWeather().following(Weather(rain=1.0), 10.0)
    assert (shower.at(10.0).wetness, shower.is_settled(10.0)) == (0.0, False)
    wet_after = shower.at(30.0).wetness
    assert wet_after == pytest.approx(1.0 - math.exp(-1.0))
    assert shower.at(1000.0).wetness == 1.0
    assert shower.is_settled(1000.0)
    sunshine = shower.following(Weather(), 1000.0)
    assert sunshine.at(1300.0).wetness == pytest.approx(math.exp(-1.0))
    assert sunshine.at(1020.0).wetness == pytest.approx(math.exp(-20.0 / 300.0))
    assert sunshine.at(1e5).wetness == 0.0


def test_the_wetness_that_was_set_stays() -> None:
    held = ChangingWeather().following(Weather(rain=1.0, wetness=0.3), 5.0)
    assert held.at(5.0).wetness == held.at(500.0).wetness == 0.3
    assert held.is_settled(5.0)


FLAT = {"extremum_value": 0.7, "asymptote_value": 0.7}
"""A tyre whose force does not depend on the slip where it slides."""
NO_DRAG = {"drag": 0.0, "drag_area": 0.0}


def test_braking_distance_is_the_square_of_the_speed_over_friction() -> None:
    batch = autodrive.BatchWorld(autodrive.Scenario(map="plane"), n=3, threads=1)
    spec = batch.compiled.vehicles["V1"]
    curves: dict[str, Any] = {
        name: getattr(spec.wheels, name).model_copy(update=FLAT) for name in ("forward_friction", "sideways_friction")
    }
    wheels = spec.wheels.model_copy(update=curves)
    sliding = spec.model_copy(update={"wheels": wheels, "body": spec.body.model_copy(update=NO_DRAG)})
    speed = 3.0
    weathers = [Weather(), Weather(wetness=1.0), Weather(snow_cover=1.0)]
    start = (
        batch.reset(motions={"V1": (speed, 0.0, 0.0, 0.0, 0.0)}, vehicles={"V1": [sliding] * 3}, weather=weathers)
        .position[:, 0, 0]
        .copy()
    )
    readings = batch.step(np.zeros((3, 1, 2)), 1000)
    assert np.abs(readings.velocity).max() < 1e-6
    friction = 0.7 * np.array([road(SURFACES["asphalt"], one).grip for one in weathers])
    # 3 %: the wheels are locked only after some milliseconds, and at 0.1 m/s the tyre no longer slides entirely
    assert readings.position[:, 0, 0] - start == pytest.approx(speed**2 / (2.0 * friction * 9.81), rel=0.03)


def test_snow_slows_a_rolling_wheel() -> None:
    # a car that coasts on snow loses g times the rolling resistance, here without any other
    batch = autodrive.BatchWorld(autodrive.Scenario(map="plane"), n=2, threads=1)
    spec = batch.compiled.vehicles["V1"]
    wheels = spec.wheels.model_copy(update={"damping_rate": 0.0})
    free = {"is_driven": False, "is_braked": False}
    axles = spec.axles.model_copy(
        update={
            "front": spec.axles.front.model_copy(update=free),
            "rear": spec.axles.rear.model_copy(update=free | {"is_driven": True}),
        }
    )
    body = spec.body.model_copy(update=NO_DRAG)
    coasting = spec.model_copy(update={"wheels": wheels, "axles": axles, "body": body})
    batch.reset(
        motions={"V1": (2.0, 0.0, 0.0, 0.0, 0.0)},
        vehicles={"V1": [coasting] * 2},
        weather=[Weather(), Weather(snow_cover=1.0)],
    )
    readings = batch.step(np.zeros((2, 1, 2)), 50)
    lost = 2.0 - readings.velocity[:, 0, 0]
    assert lost[0] == pytest.approx(0.0, abs=0.01)
    # 10 %: the wheels' inertia is a part of the mass that the resistance slows down, and their suspension moves
    assert lost[1] == pytest.approx(0.037 * 9.81 * 0.5, rel=0.1)


def test_a_table_of_the_tyre_replaces_that_of_the_surface() -> None:
    batch = autodrive.BatchWorld(autodrive.Scenario(map="plane"), n=1, threads=1)
    spec = batch.compiled.vehicles["V1"]
    own = type(spec.wheels).model_validate(
        spec.wheels.model_dump() | {"weather": {"wet_grip": 0.9, "snow_grip": 0.5, "snow_resistance": 0.0}}
    )
    dry = batch.worlds.wheels[0, 0]["forward"][1]
    batch.reset(vehicles={"V1": [spec.model_copy(update={"wheels": own})]}, weather=Weather(wetness=1.0))
    assert batch.worlds.wheels[0, 0]["forward"][1] == pytest.approx(0.9 * dry)


def test_presets_are_in_the_order_of_the_devkit() -> None:
    assert [*PRESETS] == [
        *("sunny", "cloudy", "light_fog", "heavy_fog"),
        *("light_rain", "heavy_rain", "light_snow", "heavy_snow"),
    ]
    for kind in ("fog", "rain", "snow"):
        assert getattr(PRESETS[f"light_{kind}"], kind) < getattr(PRESETS[f"heavy_{kind}"], kind)
