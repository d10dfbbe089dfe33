"""What hides what, and which side of a thing is seen."""

import numpy as np
import pytest

from steelyard.draw import Drawing
from steelyard_envs.rendering import Camera
from tests.envs.pictures import (
    ABOVE,
    BELOW,
    BLUE,
    GREEN,
    LEVEL,
    RED,
    color_at,
    looks,
    picture,
    pixel_of,
)

pytest.importorskip("pygame")

DECK = [(-3, 1, -3), (3, 1, -3), (3, 1, 3), (-3, 1, 3)]


@pytest.mark.parametrize("thickness", [0.0, 0.1])
@pytest.mark.parametrize("place", [(-2.0, -2.0), (2.0, 2.0), (2.0, -2.0), (0.0, 0.0)])
@pytest.mark.parametrize("slope", [-0.1, 0.0, 0.1])
def test_a_deck_hides_what_is_below_it_and_not_what_is_on_it(place, thickness, slope):
    # The distance of the middles alone gets half of these wrong.
    x, z = place
    lift = slope * x
    drawing = Drawing()
    drawing.face([(a, b + slope * a, c) for a, b, c in DECK], color=BLUE, thickness=thickness)
    drawing.circle((x, 1.4 + lift, z), 0.3, color=RED)
    drawing.line((x, 0.2 + lift, z), (x, 0.9 + lift, z), color=GREEN, width=0.3)
    on, under = (x, 1.4 + lift, z), (x, 0.55 + lift, z)
    seen_from_above = picture(drawing, camera=ABOVE)
    assert looks(color_at(seen_from_above, on, ABOVE), RED)
    assert looks(color_at(seen_from_above, under, ABOVE), BLUE)
    seen_from_below = picture(drawing, camera=BELOW)
    assert looks(color_at(seen_from_below, on, BELOW), BLUE)
    assert looks(color_at(seen_from_below, under, BELOW), GREEN)


def test_a_slab_shows_its_top_and_front_from_above():
    drawing = Drawing()
    drawing.face(DECK, color=BLUE, thickness=1.5)
    pixels = picture(drawing, camera=ABOVE)
    corner = (3, 1.75, 3)
    # The top ends at its front corner, 1.75 m high; what is lower on the picture is wall, darker.
    column, row = np.floor(pixel_of(corner, ABOVE)).astype(int)
    top, wall = pixels[row - 6, column].astype(int), pixels[row + 6, column].astype(int)
    assert looks(top, BLUE) and looks(wall, BLUE)
    assert top[2] > wall[2] + 20


def test_balls_at_the_corners_of_a_slab_and_at_the_ends_of_bars_are_whole():
    drawing = Drawing()
    drawing.face(DECK, color=BLUE, thickness=0.1)
    for corner in DECK:
        drawing.line(corner, (0, 0, 0), color=GREEN, width=0.1)
        drawing.circle(corner, 0.2, color=RED)
    pixels = picture(drawing, camera=ABOVE)
    assert all(looks(color_at(pixels, corner, ABOVE), RED) for corner in DECK)


def test_a_ball_on_a_tilted_platform_with_struts_below_is_seen():
    # Struts that pass near the ball on the picture, but not over it, must not drag the deck over
    # it: they are nearer than the ball, behind the deck, and the deck is behind the ball.
    tilt = np.radians(8.0)
    turn = np.array([[np.cos(tilt), np.sin(tilt), 0], [-np.sin(tilt), np.cos(tilt), 0], [0, 0, 1]])
    feet = np.array([(0, 0, 1), (0, 0, -1)]) @ turn
    deck = np.array([(-3, 2, 1), (4, 2, 1), (4, 2, -1), (-3, 2, -1)]) @ turn
    rider = np.array([1.1, 2.37, -0.3]) @ turn
    drawing = Drawing()
    drawing.face(deck, color=BLUE, thickness=0.1)
    for foot in feet:
        for corner in deck:
            drawing.line(foot, corner, color=GREEN, width=0.09)
    drawing.circle(rider, 0.32, color=RED)
    camera = Camera((0.4, 1.35, 0.0), 11.0, azimuth=-32.0, elevation=13.0, field_of_view=34.0)
    pixels = picture(drawing, camera=camera)
    assert looks(color_at(pixels, rider, camera), RED)
    assert looks(color_at(pixels, rider - 0.25 * turn[1], camera), RED)


@pytest.mark.parametrize("far_first", [True, False])
def test_the_nearer_ball_hides_the_farther(far_first):
    balls = [((0, 1, -2), RED), ((0, 1, 2), GREEN)]
    drawing = Drawing()
    for centre, color in balls if far_first else reversed(balls):
        drawing.circle(centre, 0.5, color=color)
    assert looks(color_at(picture(drawing), (0, 1, 0)), GREEN)


@pytest.mark.parametrize(("z", "wanted"), [(-1.0, RED), (1.0, GREEN)])
def test_a_slanted_bar_is_compared_with_a_ball_where_they_pass(z, wanted):
    # The middle of the bar is at depth 0 whatever passes the ball.
    drawing = Drawing()
    drawing.circle((2, 1, 0), 0.5, color=RED)
    drawing.line((2, 1, 2 * z), (-6, 1, -6 * z), color=GREEN, width=0.2)
    camera = LEVEL
    assert looks(color_at(picture(drawing, camera=camera), (2 - 0.2 * z, 1, z), camera), wanted)


def test_layers():
    drawing = Drawing()
    drawing.face([(-1, 0, 0), (1, 0, 0), (1, 2, 0), (-1, 2, 0)], color=BLUE)
    drawing.line((-1, 1, -1), (1, 1, -1), color=RED, width=0.3, layer=1)
    drawing.line((-1, 1.7, 1), (1, 1.7, 1), color=GREEN, width=0.3, layer=-1)
    pixels = picture(drawing)
    assert looks(color_at(pixels, (0, 1, -1)), RED)
    assert looks(color_at(pixels, (0, 1.7, 1)), BLUE)
