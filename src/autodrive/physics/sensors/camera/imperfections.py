"""Imperfections of lens, shutter and sensor of a camera, with presets of real cameras."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from autodrive.base.specs import Spec
from autodrive.base.suggest import suggest
from autodrive.physics.sensors.camera.optics import NO_DISTORTION

Hardware: TypeAlias = Literal["raspberry_pi_v1", "raspberry_pi_v2", "rectified"]

Coefficient: TypeAlias = Annotated[float, Field(ge=-1e3, le=1e3)]


class CameraImperfections(Spec):
    """Imperfections of a camera, none by default. In a file, the name of a `Hardware` selects its preset."""

    distortion: tuple[Coefficient, Coefficient, Coefficient, Coefficient, Coefficient] = NO_DISTORTION
    """k1, k2, p1, p2, k3 of the lens (Brown-Conrady, same as OpenCV and ROS 'plumb_bob')."""
    vignetting: float = Field(default=0.0, ge=0.0, le=100.0)
    """Exponent of the vignetting: light is multiplied by cos(angle to the axis)^(4 vignetting)."""
    exposure: float = Field(default=0.0, ge=-10.0, le=10.0)
    """Exposure compensation [stops]: light is multiplied by 2^exposure."""
    white_electrons: float = Field(default=0.0, ge=0.0, le=1e9)
    """Electrons in a pixel at white level, which determine the shot noise; 0: no noise."""
    read_noise: float = Field(default=0.0, ge=0.0, le=1e6)
    """Standard deviation of the read noise [electrons]."""
    exposure_time: float = Field(default=0.0, ge=0.0, le=1.0)
    """Exposure time of each row [s]; causes motion blur."""
    readout_time: float = Field(default=0.0, ge=0.0, le=1.0)
    """Delay of the last row after the first [s]; causes rolling-shutter skew."""
    exposures: int = Field(default=5, ge=3, le=65)
    """Number of images rendered over these two times, odd; one image if both are 0."""

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in PRESETS:
            raise ValueError(f"camera hardware '{value}' is not known. {suggest(value, list(PRESETS))}")
        return PRESETS[value].model_dump()

    @model_validator(mode="after")
    def _has_a_middle(self) -> CameraImperfections:
        if self.exposures % 2 == 0:
            raise ValueError(
                f"exposures must be odd, so that one exposure is at the time of the image, not {self.exposures}"
            )
        return self

    @property
    def is_none(self) -> bool:
        """Whether the camera is ideal."""
        return self == CameraImperfections(exposures=self.exposures)

    def scaled(self, factor: float) -> CameraImperfections:
        """Shot noise relative to white is 1 / sqrt(white_electrons), and none for 0; read noise is in electrons."""
        electrons = self.white_electrons / factor**2 if factor > 0.0 else 0.0
        return self.model_copy(update={"white_electrons": electrons, "read_noise": factor * self.read_noise})

    @property
    def duration(self) -> float:
        """Time from the start of the exposure of the first row to the end of that of the last row [s]."""
        return self.exposure_time + self.readout_time


# Raspberry Pi Camera V1.3. Lens: a published calibration (camerav1_1280x720.yaml of raspicam_node by Ubiquity
# Robotics). Sensor OV5647 (data sheet by OmniVision): full well 4300 electrons and dynamic range 67 dB at gain 8,
# hence read noise 4300 / 10^(67/20) = 1.9 electrons. At twice the base gain (ISO 200, as in the original) white is
# half the full well. A row of the 640 x 480 mode takes 1852 periods of a 58.333 MHz clock (Linux, ov5647.c): 480
# rows take 15.2 ms. Exposure: 1/200 s, as in the original. Vignetting: the natural cos^4 law.
_RASPBERRY_PI_V1 = CameraImperfections(
    distortion=(0.03034574724223343, -0.1510961279565394, 0.005326365853523378, -0.003855361950537075, 0.0),
    vignetting=1.0,
    white_electrons=2150.0,
    read_noise=1.9,
    exposure_time=0.005,
    readout_time=0.0152,
)

PRESETS: dict[Hardware, CameraImperfections] = {
    "raspberry_pi_v1": _RASPBERRY_PI_V1,
    # Raspberry Pi Camera V2. Lens: camerav2_1280x720.yaml of the same package. Sensor IMX219: full well and read noise
    # are not published; these are measurements of its successor IMX477 (3400 electrons/um^2, 3 electrons;
    # strollswithmydog.com) for pixels of 1.12 um, also at twice the base gain. A row takes 3448 periods of a 182.4 MHz
    # clock (Linux, imx219.c): 720 rows take 13.6 ms.
    "raspberry_pi_v2": CameraImperfections(
        distortion=(0.1465167016954302, -0.2847343180128725, 0.00134017721235817, -0.004309553450829512, 0.0),
        vignetting=1.0,
        white_electrons=2130.0,
        read_noise=3.0,
        exposure_time=0.005,
        readout_time=0.0136,
    ),
    # A camera whose driver removes the distortion of the lens, as that of the ZED does, with the first sensor.
    "rectified": _RASPBERRY_PI_V1.model_copy(update={"distortion": NO_DISTORTION}),
}
"""Imperfections by the name of the hardware."""
