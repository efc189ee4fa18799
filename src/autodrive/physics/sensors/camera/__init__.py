"""Cameras: Spec, lens, exposure and imperfections, and points of a map in an image."""

from autodrive.physics.sensors.camera.optics import project as project
from autodrive.physics.sensors.camera.optics import rays as rays
