"""A world as a list of lines, circles and faces; no window code."""

from . import palette
from .primitives import Circle, Drawing, Face, Line, Text

__all__ = ["Circle", "Drawing", "Face", "Line", "Text", "palette"]
