"""The public import path of `BatchCamera`."""

from autodrive.world.views.batch_camera import BatchCamera

__all__ = ["BatchCamera"]
