"""Settings of the sensors of one vehicle in a scenario: on or off, rate, and a preset of the noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, get_args

from autodrive.base.errors import SpecError
from autodrive.base.specs import Spec, checked
from autodrive.base.suggest import suggest
from autodrive.physics.sensors.camera.camera import CameraSpec
from autodrive.physics.sensors.catalog import SensorSuiteSpec
from autodrive.physics.sensors.sensor import NoisePreset, NoisySpec, Rate


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

    spec: Any
    """Spec of a sensor (`catalog.SensorSuiteSpec`) or of a camera."""
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
    specs: dict[str, Any] = {name: spec for name, spec in suite if spec is not None} | dict(cameras)
    errors = [f"{name}: no such sensor. {suggest(name, list(specs))}" for name in settings if name not in specs]
    sensors: dict[str, ConfiguredSensor] = {}
    for name, spec in specs.items():
        chosen = settings.get(name, SensorSettings())
        presets = noise_presets(spec)
        usual: NoisePreset = "realistic" if is_realistic and "realistic" in presets else "file"
        noise = chosen.noise or usual
        if noise in presets:
            try:
                configured = _configured(spec, chosen.rate, noise).with_noise_factor(noise_factor)
                sensors[name] = ConfiguredSensor(configured, chosen.is_on, noise)
            except SpecError as error:  # the lens of a realistic camera may not cover its image
                errors += [f"{name}: with noise '{noise}', {problem}" for problem in error.errors]
        else:
            errors.append(f"{name}.noise: '{noise}' is not known for this sensor. {suggest(noise, list(presets))}")
    if errors:
        raise SpecError(errors)
    return sensors


def noise_presets(spec: NoisySpec) -> tuple[NoisePreset, ...]:
    """The presets of that sensor: 'realistic' only if its data sheet has noise."""
    return tuple(preset for preset in get_args(NoisePreset) if preset == "file" or preset in spec.noises)


def _configured(spec: Any, rate: float | None, noise: NoisePreset) -> Any:
    changes: dict[str, Any] = {} if rate is None else {"rate": rate}
    if noise != "file":
        changes[spec.NOISE] = spec.noises[noise]
    return checked(dict(spec) | changes, type(spec)) if changes else spec
