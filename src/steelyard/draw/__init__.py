"""A world as a list of lines, circles and faces; no window code."""

from . import palette
from .primitives import Circle, Drawing, Face, Line, Text
from .world import draw_world

__all__ = ["Circle", "Drawing", "Face", "Line", "Text", "draw_world", "palette"]
