"""Settings of the sensors of one vehicle in a scenario: on or off, rate, and a preset of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, TypeVar, get_args

from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec, checked
from autodrive.base.suggest import suggest
from autodrive.physics.sensors.camera import CameraSpec
from autodrive.physics.sensors.camera_imperfections import PRESETS, CameraImperfections
from autodrive.physics.sensors.catalog import SensorSuiteSpec
from autodrive.physics.sensors.encoder import EncoderSpec
from autodrive.physics.sensors.imu import ImuNoise, ImuSpec
from autodrive.physics.sensors.ips import IpsSpec
from autodrive.physics.sensors.lidar import LidarSpec
from autodrive.physics.sensors.lidar_noise import LidarNoise
from autodrive.physics.sensors.noise import NoiseSpec
from autodrive.physics.sensors.range import RangeSpec
from autodrive.physics.sensors.sensor import Rate

NoisePreset: TypeAlias = Literal["ideal", "file", "realistic", "strong"]
"""'ideal': no noise; 'file': as in the vehicle's file; 'realistic': of the data sheet; 'strong': a multiple."""

SensorSpecs: TypeAlias = EncoderSpec | IpsSpec | ImuSpec | LidarSpec | RangeSpec | CameraSpec

STRONG = 5.0
"""Strong noise has this multiple of the standard deviations of the data sheet; resolutions stay."""

STRONG_NOISE = {EncoderSpec: 0.05, IpsSpec: 0.05, RangeSpec: 0.05}
"""Strong white noise of the sensors without noise in a data sheet [rad], [m], [m]: our choice."""


class SensorSettings(Spec):
    """Settings of one sensor or camera; what is left out is as in the vehicle's file."""

    is_on: bool = True
    """False: no LIDAR scans, ranges or images; encoders, IPS and IMU keep their first reading."""
    rate: Rate | None = None
    """Sample rate [Hz], at most one sample per tick."""
    noise: NoisePreset | None = None
    """Preset of the noise; left out: 'realistic' for a vehicle with realistic sensors, else 'file'."""


@dataclass(frozen=True)
class ConfiguredSensor:
    """A sensor as it runs: the Spec of the vehicle's file with the settings of the scenario."""

    spec: SensorSpecs
    is_on: bool
    noise: NoisePreset


def configured_sensors(
    suite: SensorSuiteSpec,
    cameras: Mapping[str, CameraSpec],
    settings: Mapping[str, SensorSettings],
    *,
    is_realistic: bool,
    noise_factor: float = 1.0,
) -> dict[str, ConfiguredSensor]:
    """The sensors, then the cameras of a vehicle by name. Raises `SpecError` with all errors.

    `noise_factor` multiplies the noise of all of them.
    """
    specs: dict[str, SensorSpecs] = {name: spec for name, spec in suite if spec is not None} | dict(cameras)
    errors = [f"{name}: no such sensor. {suggest(name, list(specs))}" for name in settings if name not in specs]
    sensors: dict[str, ConfiguredSensor] = {}
    for name, spec in specs.items():
        its = settings.get(name, SensorSettings())
        presets = noise_presets(spec)
        usual: NoisePreset = "realistic" if is_realistic and "realistic" in presets else "file"
        noise = its.noise or usual
        if noise in presets:
            try:
                configured = with_noise_factor(_configured(spec, its.rate, noise), noise_factor)
                sensors[name] = ConfiguredSensor(configured, its.is_on, noise)
            except SpecError as error:  # the lens of a realistic camera may not cover its image
                errors += [f"{name}: with noise '{noise}', {one}" for one in error.errors]
        else:
            errors.append(f"{name}.noise: '{noise}' is not known for this sensor. {suggest(noise, list(presets))}")
    if errors:
        raise SpecError(errors)
    return sensors


def noise_presets(spec: SensorSpecs) -> tuple[NoisePreset, ...]:
    """The presets of that sensor: 'realistic' only if its data sheet has noise."""
    return tuple(one for one in get_args(NoisePreset) if one != "realistic" or type(spec) not in STRONG_NOISE)


Configured = TypeVar("Configured", bound=SensorSpecs)


def _configured(spec: Configured, rate: float | None, noise: NoisePreset) -> Configured:
    changes: dict[str, Any] = {} if rate is None else {"rate": rate}
    if noise != "file":
        field = "imperfections" if isinstance(spec, CameraSpec) else "noise"
        changes[field] = _noise(spec, noise)
    return checked(dict(spec) | changes, type(spec)) if changes else spec


def _noise(spec: SensorSpecs, preset: NoisePreset) -> Spec:
    noises: dict[NoisePreset, Spec]
    match spec:
        case ImuSpec():
            real = ImuNoise.realistic()
            strong = ImuNoise(**{name: _scaled(noise, STRONG) for name, noise in real})
            noises = {"ideal": ImuNoise(), "realistic": real, "strong": strong}
        case LidarSpec():
            real = spec.data_sheet
            noises = {"ideal": LidarNoise(), "realistic": real, "strong": _scaled_lidar(real, STRONG)}
        case CameraSpec():
            real = PRESETS[spec.hardware]
            noises = {"ideal": CameraImperfections(), "realistic": real, "strong": _scaled_camera(real, STRONG)}
        case _:
            noises = {"ideal": NoiseSpec(), "strong": NoiseSpec(sigma=STRONG_NOISE[type(spec)])}
    return noises[preset]


def with_noise_factor(spec: Configured, factor: float) -> Configured:
    """The same sensor with `factor` times the noise; resolutions stay."""
    if factor == 1.0:
        return spec
    match spec:
        case ImuSpec():
            noise: Spec = ImuNoise(**{name: _scaled(one, factor) for name, one in spec.noise})
        case LidarSpec():
            noise = _scaled_lidar(spec.noise, factor)
        case CameraSpec():
            return spec.model_copy(update={"imperfections": _scaled_camera(spec.imperfections, factor)})
        case _:
            noise = _scaled(spec.noise, factor)
    return spec.model_copy(update={"noise": noise})


def _scaled(noise: NoiseSpec, factor: float) -> NoiseSpec:
    scaled = {"sigma": factor * noise.sigma, "offset": factor * noise.offset, "walk": factor * noise.walk}
    return noise.model_copy(update=scaled)


def _scaled_lidar(noise: LidarNoise, factor: float) -> LidarNoise:
    return noise.model_copy(
        update={
            "sigma": factor * noise.sigma,
            "relative_sigma": factor * noise.relative_sigma,
            "scale": factor * noise.scale,
            "dropout": min(1.0, factor * noise.dropout),
        }
    )


def _scaled_camera(noise: CameraImperfections, factor: float) -> CameraImperfections:
    """Shot noise relative to white is 1 / sqrt(white_electrons), and none for 0; read noise is in electrons."""
    electrons = noise.white_electrons / factor**2 if factor > 0.0 else 0.0
    return noise.model_copy(update={"white_electrons": electrons, "read_noise": factor * noise.read_noise})
