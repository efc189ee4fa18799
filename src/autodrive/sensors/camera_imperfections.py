"""What a real camera does to a picture: its lens, its shutter and its sensor, and figures of two real ones."""

from __future__ import annotations

from typing import Any, Literal, TypeAlias

from pydantic import Field, NonNegativeFloat, model_validator

from autodrive.descriptions import Spec, suggest
from autodrive.sensors.camera_optics import NO_DISTORTION, Distortion

Hardware: TypeAlias = Literal["raspberry_pi_v1", "raspberry_pi_v2"]


class CameraImperfections(Spec):
    """None by default. In a file, the name of a `Hardware` stands for the figures of that camera."""

    distortion: Distortion = NO_DISTORTION
    """k1, k2, p1, p2, k3 of the lens (Brown-Conrady, as OpenCV and ROS 'plumb_bob')."""
    vignetting: NonNegativeFloat = 0.0
    """How much darker the corners are: light is multiplied by cos(angle to the axis)^(4 vignetting)."""
    exposure: float = Field(default=0.0, ge=-10.0, le=10.0)
    """Brighter by so many stops: light is multiplied by 2^exposure."""
    white_electrons: NonNegativeFloat = 0.0
    """Electrons in a pixel that is just white, from which its shot noise follows; 0: no noise at all."""
    read_noise: NonNegativeFloat = 0.0
    """Standard deviation of the electrons that reading adds."""
    exposure_time: float = Field(default=0.0, ge=0.0, le=1.0)
    """How long each row is exposed [s]; what moves meanwhile is blurred."""
    readout_time: float = Field(default=0.0, ge=0.0, le=1.0)
    """How much later the last row is exposed than the first [s]; what moves sideways meanwhile leans."""
    exposures: int = Field(default=5, ge=3, le=65)
    """How many pictures are drawn over these two times, an odd number; one if both are 0."""

    @model_validator(mode="before")
    @classmethod
    def _preset(cls, value: Any) -> Any:
        if not isinstance(value, str):
            return value
        if value not in PRESETS:
            raise ValueError(f"'{value}' is no camera whose figures are known. {suggest(value, list(PRESETS))}")
        return PRESETS[value].model_dump()

    @model_validator(mode="after")
    def _has_a_middle(self) -> CameraImperfections:
        if self.exposures % 2 == 0:
            raise ValueError(f"exposures {self.exposures} must be odd, so that one is that of the picture's time")
        return self

    @property
    def is_none(self) -> bool:
        """Whether it changes nothing."""
        return self == CameraImperfections(exposures=self.exposures)

    @property
    def duration(self) -> float:
        """From the first light of the first row to the last of the last [s]."""
        return self.exposure_time + self.readout_time


PRESETS = {
    # Raspberry Pi Camera V1.3. Lens: a calibration that users share (camerav1_1280x720.yaml of raspicam_node by
    # Ubiquity Robotics). Sensor OV5647, by its data sheet (OmniVision): a well of 4300 electrons, and a dynamic range
    # of 67 dB at gain 8, which makes reading 4300 / 10^(67/20) = 1.9 electrons. At twice the base gain (ISO 200, as the
    # original has it) half a well is white. Rows of the 640 x 480 mode are 1852 pixels of a 58.333 MHz clock long
    # (Linux, ov5647.c): 480 of them take 15.2 ms. Exposure: 1/200 s, as the original. Vignetting: the natural law.
    "raspberry_pi_v1": CameraImperfections(
        distortion=(0.03034574724223343, -0.1510961279565394, 0.005326365853523378, -0.003855361950537075, 0.0),
        vignetting=1.0,
        white_electrons=2150.0,
        read_noise=1.9,
        exposure_time=0.005,
        readout_time=0.0152,
    ),
    # Raspberry Pi Camera V2. Lens: likewise (camerav2_1280x720.yaml). Sensor IMX219: the maker publishes neither well
    # nor read noise; these are measured ones of its successor IMX477 (3400 electrons/um^2, 3 electrons;
    # strollswithmydog.com) for pixels of 1.12 um, again at twice the base gain. Rows are 3448 pixels of a 182.4 MHz
    # clock long (Linux, imx219.c): 720 take 13.6 ms.
    "raspberry_pi_v2": CameraImperfections(
        distortion=(0.1465167016954302, -0.2847343180128725, 0.00134017721235817, -0.004309553450829512, 0.0),
        vignetting=1.0,
        white_electrons=2130.0,
        read_noise=3.0,
        exposure_time=0.005,
        readout_time=0.0136,
    ),
}
"""By the name of the hardware."""
