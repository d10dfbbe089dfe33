"""Drawings of a world as pictures; pygame is imported when a `Renderer` is made, not before."""

from .camera import Camera
from .renderer import Renderer

__all__ = ["Camera", "Renderer"]
