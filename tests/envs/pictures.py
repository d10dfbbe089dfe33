"""Small pictures with a known scale, and questions to ask of their pixels."""

import numpy as np

from steelyard_envs.rendering import Camera, Renderer
from steelyard_envs.rendering.camera import View

WIDTH, HEIGHT = 320, 240
RED, GREEN, BLUE = (255, 0, 0), (0, 255, 0), (0, 0, 255)
# From 10 m ahead of (0, 1, 0); tan(45 / 2 degrees) = .41421, so a metre there is
# 120 / .41421 / 10 = 28.97 px.
LEVEL = Camera(target=(0.0, 1.0, 0.0), distance=10.0, azimuth=0.0, elevation=0.0, field_of_view=45)
METRE = 0.5 * HEIGHT / np.tan(np.pi / 8) / 10.0
ABOVE = Camera(target=(0.0, 1.0, 0.0), distance=10.0, azimuth=20.0, elevation=20.0)
BELOW = Camera(target=(0.0, 1.0, 0.0), distance=10.0, azimuth=20.0, elevation=-20.0)


def picture(drawing, *, camera=LEVEL, width=WIDTH, height=HEIGHT):
    renderer = Renderer(width=width, height=height, camera=camera)
    pixels = renderer.render(drawing)
    renderer.close()
    return pixels


def pixel_of(point, camera=LEVEL):
    view = View(camera, width=WIDTH, height=HEIGHT)
    return view.to_pixels(view.from_world(np.array([point], float)))[0]


def color_at(pixels, point, camera=LEVEL):
    column, row = np.floor(pixel_of(point, camera)).astype(int)
    return pixels[row, column].astype(int)


def looks(color, wanted):
    """Whether the strongest channel is that of a primary colour, by far."""
    channel = int(np.argmax(wanted))
    return all(color[channel] > other + 60 for c, other in enumerate(color) if c != channel)


def extent(mask):
    rows, columns = np.nonzero(mask)
    return columns.min(), columns.max(), rows.min(), rows.max()
