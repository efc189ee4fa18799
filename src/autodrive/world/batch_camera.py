"""The public import path of `BatchCamera` and of what it draws."""

from autodrive.graphics.render.render_state import RenderState
from autodrive.world.views.batch_camera import BatchCamera

__all__ = ["BatchCamera", "RenderState"]
