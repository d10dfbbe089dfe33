"""Drawings as pictures: where things land, what hides what, and what a bad world looks like."""

import subprocess
import sys
import time

import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled

from steelyard.draw import Drawing
from steelyard_envs.rendering import Camera, Renderer
from steelyard_envs.rendering.backdrop import backdrop, grid_spacing
from steelyard_envs.rendering.camera import View
from tests.envs.pictures import (
    ABOVE,
    BLUE,
    GREEN,
    HEIGHT,
    LEVEL,
    METRE,
    RED,
    WIDTH,
    color_at,
    extent,
    looks,
    picture,
    pixel_of,
)

pygame = pytest.importorskip("pygame")


@pytest.mark.parametrize("size", [(WIDTH, HEIGHT), (321, 123), (1, 1)])
def test_rgb_array_is_a_picture_of_the_size_asked_for(size):
    width, height = size
    pixels = picture(Drawing(), width=width, height=height)
    assert pixels.shape == (height, width, 3)
    assert pixels.dtype == np.uint8
    assert pixels.flags.c_contiguous and pixels.flags.writeable


def test_every_frame_is_an_array_of_its_own():
    drawing = Drawing()
    drawing.circle((0, 1, 0), 1.0, color=RED)
    renderer = Renderer(width=WIDTH, height=HEIGHT, camera=LEVEL)
    first = renderer.render(drawing)
    kept = first.copy()
    renderer.render(Drawing())
    np.testing.assert_array_equal(first, kept)


def test_same_drawing_same_pixels_whatever_was_drawn_before():
    drawing = Drawing()
    drawing.face([(-2, 1, -1), (2, 1, -1), (2, 1, 1), (-2, 1, 1)], thickness=0.1)
    drawing.circle((0, 1.5, 0), 0.4, color=RED)
    drawing.line((-2, 0, 0), (2, 3, 0), color=(0, 0, 0, 120), width=0.1)
    drawing.text("time", value="1.0 s")
    renderer = Renderer(width=WIDTH, height=HEIGHT, camera=LEVEL)
    first = renderer.render(drawing)
    elsewhere = Camera(azimuth=77.0)
    renderer.camera = elsewhere
    np.testing.assert_array_equal(renderer.render(drawing), picture(drawing, camera=elsewhere))
    renderer.camera = LEVEL
    np.testing.assert_array_equal(renderer.render(drawing), first)
    np.testing.assert_array_equal(picture(drawing), first)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "point", "offset"),
    [
        (0.0, 0.0, (1.0, 1.0, 0.0), (1.0, 0.0)),  # seen from +z, +x is to the right
        (90.0, 0.0, (0.0, 1.0, -1.0), (1.0, 0.0)),  # seen from +x, -z is to the right
        (180.0, 0.0, (-1.0, 1.0, 0.0), (1.0, 0.0)),
        (0.0, 0.0, (0.0, 2.0, 0.0), (0.0, -1.0)),  # up is up
        (0.0, 30.0, (0.0, 1.0 + np.cos(np.pi / 6), -0.5), (0.0, -1.0)),  # along the picture's up
        (0.0, 0.0, (1.0, 1.0, -10.0), (0.5, 0.0)),  # twice as far, half as large
    ],
)
def test_projection(azimuth, elevation, point, offset):
    camera = Camera((0.0, 1.0, 0.0), 10.0, azimuth, elevation, 45.0)
    middle = np.array([WIDTH / 2, HEIGHT / 2])
    expected = middle + METRE * np.array(offset)
    np.testing.assert_allclose(pixel_of(point, camera), expected, rtol=0, atol=1e-9)


def test_line_lands_where_it_should():
    drawing = Drawing()
    drawing.line((-1, 2, 0), (2, 2, 0), color=RED, pixels=2)
    left, right, top, bottom = extent((picture(drawing) == RED).all(axis=2))
    # 2 px about the row one metre above the middle; rims share their pixel with the background.
    assert abs(left - (WIDTH / 2 - METRE)) <= 1
    assert abs(right - (WIDTH / 2 + 2 * METRE)) <= 1
    assert top >= HEIGHT / 2 - METRE - 2 and bottom <= HEIGHT / 2 - METRE + 1
    assert bottom - top <= 2


def test_line_width_in_metres_shrinks_with_distance_down_to_its_pixels():
    def breadth(depth, pixels):
        drawing = Drawing()
        drawing.line((0, -9, depth), (0, 11, depth), color=RED, width=0.5, pixels=pixels, layer=1)
        # A pixel counts when the line covers more than half of it: little green is left there.
        return int((picture(drawing)[HEIGHT // 2, :, 1] < 120).sum())

    # Half a pixel of rounding, and the rim of a painted polygon belongs to it: half a pixel a side.

    assert breadth(0, 1) == pytest.approx(0.5 * METRE, abs=1.5)
    assert breadth(-10, 1) == pytest.approx(0.25 * METRE, abs=1.5)
    assert breadth(-990, 5) == pytest.approx(5, abs=1.5)


def test_ball_lands_where_it_should():
    drawing = Drawing()
    drawing.circle((1, 2, 0), 0.8, color=GREEN)
    green = np.apply_along_axis(looks, 2, picture(drawing).astype(int), GREEN)
    left, right, top, bottom = extent(green)
    assert (left + right + 1) / 2 == pytest.approx(WIDTH / 2 + METRE, abs=1)
    assert (top + bottom + 1) / 2 == pytest.approx(HEIGHT / 2 - METRE, abs=1)
    assert right - left + 1 == pytest.approx(1.6 * METRE, abs=2)


def test_disc_and_ring_follow_their_axis():
    drawing = Drawing()
    drawing.circle((-2, 1, 0), 1.0, color=RED, normal=(0, 0, 3))
    drawing.circle((2, 1, 0), 1.0, color=RED, normal=(1, 0, 0))  # seen from its edge
    drawing.circle((0, 2.5, 0), 0.5, color=BLUE, fill=False)
    pixels = picture(drawing)
    assert looks(color_at(pixels, (-2.9, 1, 0)), RED)
    assert not looks(color_at(pixels, (1.5, 1, 0)), RED)
    assert not looks(color_at(pixels, (0, 2.5, 0)), BLUE)
    np.testing.assert_array_equal(
        color_at(pixels, (0, 2.5, 0)), color_at(picture(Drawing()), (0, 2.5, 0))
    )
    assert looks(color_at(pixels, (0.49, 2.5, 0)), BLUE)


@pytest.mark.parametrize("depth", [10.0, 10.1, 500.0])
def test_what_is_behind_the_camera_is_not_drawn(depth):
    drawing = Drawing()
    drawing.circle((0, 1, depth), 0.3, color=RED)
    drawing.circle((0, 1, depth), 0.3, color=RED, normal=(0, 0, 1))
    drawing.circle((0, 1, depth), 0.3, color=RED, fill=False)
    drawing.line((-1, 1, depth), (1, 1, depth), color=RED, width=0.2)
    drawing.face([(-1, 1, depth), (1, 1, depth), (0, 2, depth)], color=RED, thickness=0.1)
    drawing.text("behind", position=(0, 1, depth))
    np.testing.assert_array_equal(picture(drawing), picture(Drawing()))


def test_a_line_through_the_camera_is_cut_at_it():
    # It starts 10 m ahead and 2 m to the right, and ends 10 m behind: what is seen of it runs
    # from there to the right rim.
    drawing = Drawing()
    drawing.line((2, 1, 0), (2, 1, 20), color=RED, pixels=3, layer=1)
    red = np.apply_along_axis(looks, 2, picture(drawing).astype(int), RED)
    left, right, top, bottom = extent(red)
    assert left == pytest.approx(WIDTH / 2 + 2 * METRE, abs=2)
    assert right == WIDTH - 1
    assert top >= HEIGHT / 2 - 4 and bottom <= HEIGHT / 2 + 4


def test_things_far_larger_than_the_picture_are_drawn():
    drawing = Drawing()
    far = 1e8
    drawing.face([(-far, -1, -far), (far, -1, -far), (far, -1, far), (-far, -1, far)], color=RED)
    drawing.line((-far, 3, 0), (far, 3, 0), color=GREEN, width=0.3)
    drawing.circle((far, far, -far), 1.0, color=BLUE)
    drawing.circle((0, 3, 0), far, color=BLUE, normal=(0, 1, 0), fill=False)
    pixels = picture(drawing).astype(int)
    assert all(looks(color, RED) for color in pixels[-1])
    row = int(HEIGHT / 2 - 2 * METRE)
    assert all(looks(color, GREEN) for color in pixels[row])


def test_clipping_keeps_to_the_plane_of_a_polygon_and_inside_the_picture():
    view = View(LEVEL, width=WIDTH, height=HEIGHT)
    random = np.random.default_rng(5)
    met = 0
    for _ in range(300):
        corners = random.normal(scale=8.0, size=(3, 3)) + np.array([0.0, 0.0, 5.0])
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        clipped = view.clip_polygon(corners)
        if len(clipped) == 0:
            continue
        met += len(clipped) > 3
        # Relative to the area times the size of the scene, rounding of some ten operations.
        off = (clipped - corners[0]) @ normal
        assert np.abs(off).max() <= 1e-13 * np.abs(normal).sum() * 100
        assert clipped[:, 2].min() >= view.near - 1e-12
        pixels = view.to_pixels(clipped)
        assert np.abs(pixels[:, 0] - WIDTH / 2).max() <= 1.25 * WIDTH / 2 * (1 + 1e-9)
        assert np.abs(pixels[:, 1] - HEIGHT / 2).max() <= 1.25 * HEIGHT / 2 * (1 + 1e-9)
    assert met > 50
    whole = np.array([[-1.0, 0.0, 10.0], [1.0, 0.0, 10.0], [0.0, 1.0, 10.0]])
    np.testing.assert_array_equal(view.clip_polygon(whole), whole)


def test_translucent_colours_mix_once():
    def face(alpha, times=1):
        drawing = Drawing()
        for _ in range(times):
            drawing.line((-1, 2, 0), (1, 2, 0), color=(*RED, alpha), width=0.5)
        return color_at(picture(drawing), (0, 2, 0))

    bare, full, half = face(0), face(255), face(128)
    np.testing.assert_array_equal(bare, color_at(picture(Drawing()), (0, 2, 0)))
    flat = np.array(RED)
    np.testing.assert_allclose(half, bare + (flat - bare) * 128 / 255, atol=2)
    assert full[0] > 200 and full[1] < 60


def test_solid_things_throw_a_shadow_on_the_ground_below_them():
    def ground(height, **options):
        drawing = Drawing()
        drawing.circle((0, height, 0), 0.8, color=RED, **options)
        return int(color_at(picture(drawing, camera=ABOVE), (0.3, 0, 0.3), ABOVE).sum())

    bare = int(color_at(picture(Drawing(), camera=ABOVE), (0.3, 0, 0.3), ABOVE).sum())
    assert ground(3.5) < bare - 60
    assert ground(3.5, layer=1) == bare
    assert ground(-3.5) == bare
    assert ground(3.5, fill=False) == bare


def test_no_ground_is_seen_from_below_it():
    pixels = picture(Drawing(), camera=Camera(target=(0.0, -5.0, 0.0), elevation=0.0))
    assert (pixels == pixels[:, :1]).all()


def test_grid_lines_lie_on_round_metres():
    view = View(ABOVE, width=WIDTH, height=HEIGHT)
    spacing = grid_spacing(ABOVE.distance)
    pixels = backdrop(view).astype(int)

    def brightness(point):
        return int(color_at(pixels, point, ABOVE).sum())

    for x, z in ((0.0, 0.5), (1.0, 0.5), (-1.0, 1.5), (0.5, 2.0)):
        on, off = (x * spacing, 0, z * spacing), ((x + 0.3) * spacing, 0, (z + 0.25) * spacing)
        assert brightness(on) > brightness(off) + 20


@pytest.mark.parametrize(
    ("distance", "spacing"), [(6.0, 1.0), (11.9, 1.0), (12.0, 2.0), (30.0, 5.0), (60.0, 10.0)]
)
def test_grid_spacing(distance, spacing):
    assert grid_spacing(distance) == pytest.approx(spacing, rel=1e-12)


def test_text_stands_in_the_corner_or_at_its_place():
    drawing = Drawing()
    drawing.text("time", value="1.0 s")
    changed = (picture(drawing) != picture(Drawing())).any(axis=2)
    _, right, _, bottom = extent(changed)
    assert right < WIDTH / 2 and bottom < HEIGHT / 4

    drawing = Drawing()
    drawing.text("here", position=(1, 2, 0), color=BLUE)
    left, right, top, bottom = extent((picture(drawing) != picture(Drawing())).any(axis=2))
    assert (left + right) / 2 == pytest.approx(WIDTH / 2 + METRE, abs=4)
    assert (top + bottom) / 2 == pytest.approx(HEIGHT / 2 - METRE, abs=4)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e300])
def test_a_world_that_has_blown_up_still_makes_a_picture_and_says_so(bad):
    sound, broken = Drawing(), Drawing()
    sound.circle((1, 1, 0), 0.5, color=RED)
    broken.extend(sound)
    broken.line((0, 1, 0), (0, bad, 0))
    broken.circle((bad, 0, 0), 0.1)
    broken.circle((0, 0, 0), abs(bad))
    broken.face([(0, 0, 0), (1, 0, bad), (1, 1, 0)], thickness=0.1)
    broken.text("label", position=(0, bad, 0))
    changed = (picture(broken) != picture(sound)).any(axis=2)
    assert changed[:60, :200].any()  # the panel that says so
    assert not changed[60:].any() and not changed[:, 200:].any()


@pytest.mark.parametrize(
    "draw",
    [
        lambda d: d.line((0, 0, 0), (0, 0, 0), width=0.2),
        lambda d: d.line((0, 1, 0), (0, 1, 5), width=0.2),  # seen end on
        lambda d: d.face([(0, 0, 0), (1, 0, 0), (2, 0, 0)], thickness=0.2),
        lambda d: d.circle((0, 1, 0), 0.0),
        lambda d: d.circle((0, 1, 0), 0.0, fill=False),
        lambda d: d.circle((0, 1, 0), 0.0, normal=(0, 1, 0)),
        lambda d: d.circle((0, 1, 9.5), 2.0, color=RED),  # the camera is inside
    ],
)
def test_things_without_extent_are_no_error(draw):
    drawing = Drawing()
    draw(drawing)
    with np.errstate(all="raise", under="ignore"):
        picture(drawing)


def test_rgb_array_needs_no_display():
    picture(Drawing())
    assert not pygame.display.get_init()


def test_closing_twice_and_rendering_again_are_fine():
    renderer = Renderer(width=WIDTH, height=HEIGHT, camera=LEVEL)
    renderer.close()
    first = renderer.render(Drawing())
    renderer.close()
    renderer.close()
    np.testing.assert_array_equal(renderer.render(Drawing()), first)


def test_human_mode_shows_the_same_picture_in_a_window(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    drawing = Drawing()
    drawing.circle((0, 1, 0), 0.5, color=RED)
    renderer = Renderer(width=WIDTH, height=HEIGHT, render_mode="human", camera=LEVEL)
    try:
        assert renderer.render(drawing) is None
        shown = pygame.surfarray.array3d(pygame.display.get_surface()).transpose(1, 0, 2)
        np.testing.assert_array_equal(shown, picture(drawing))
    finally:
        renderer.close()
    assert not pygame.display.get_init()
    renderer.close()


def test_human_mode_holds_the_frame_rate(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    renderer = Renderer(width=32, height=32, render_mode="human", render_fps=20)
    try:
        renderer.render(Drawing())
        start = time.perf_counter()
        for _ in range(4):
            renderer.render(Drawing())
        # Four frames of 50 ms; the clock counts in whole milliseconds.
        assert time.perf_counter() - start >= 0.19
    finally:
        renderer.close()


def test_importing_the_module_does_not_import_pygame():
    code = "import sys, steelyard_envs.rendering; assert 'pygame' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_without_pygame_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pygame", None)
    with pytest.raises(DependencyNotInstalled, match=r'pip install "steelyard\[render\]"'):
        Renderer()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Renderer(render_mode="ansi"), "render_mode is 'ansi'.*rgb_array"),
        (lambda: Renderer(width=0), "0 x 480"),
        (lambda: Renderer(render_fps=0), "render_fps is 0"),
        (lambda: Camera(distance=0.0), "distance is 0.0 m"),
        (lambda: Camera(distance=np.nan), "distance is nan"),
        (lambda: Camera(elevation=90.0), "elevation is 90.0"),
        (lambda: Camera(field_of_view=180.0), "field of view is 180.0"),
        (lambda: Drawing().line((0, 0), (1, 1, 1)), r"three coordinates.*\(0, 0\)"),
        (lambda: Drawing().line((0, 0, 0), (1, 1, 1), width=-1.0), "width is -1.0"),
        (lambda: Drawing().line((0, 0, 0), (1, 1, 1), color=(0, 0, 256)), r"\(0, 0, 256\)"),
        (lambda: Drawing().circle((0, 0, 0), -1.0), "radius is -1.0"),
        (lambda: Drawing().circle((0, 0, 0), 1.0, normal=(0, 0, 0)), "no direction"),
        (lambda: Drawing().face([(0, 0, 0), (1, 0, 0)]), "2 points"),
    ],
)
def test_bad_input_is_refused_with_its_value(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_extend_adds_everything_and_leaves_the_other_alone():
    one, two = Drawing(), Drawing()
    one.line((0, 0, 0), (1, 0, 0))
    two.line((0, 0, 0), (0, 1, 0))
    two.circle((0, 0, 0), 1.0)
    two.face([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    two.text("label")
    one.extend(two)
    assert [len(part) for part in (one.lines, one.circles, one.faces, one.texts)] == [2, 1, 1, 1]
    assert len(two.lines) == 1
    assert one.lines[1] is two.lines[0]
