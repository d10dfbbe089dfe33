"""Drawings as pixels or in a window, with pygame."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.error import DependencyNotInstalled
from numpy.typing import NDArray

from .backdrop import backdrop
from .camera import Camera, View
from .captions import Captions, Row
from .order import back_to_front
from .painter import Painter
from .shapes import Drawable, Projector, Shape, drawable_part

if TYPE_CHECKING:
    import steelyard as sy

# Everything but text is painted this much larger and then scaled down, which smooths all edges.
SUPERSAMPLING = 2
RENDER_MODES = ("human", "rgb_array")
WARNING = (190, 40, 40)


class Renderer:
    """Paints drawings of a world.

    Args:
        width, height: of the picture [px].
        render_mode: "rgb_array" returns pixels and needs no display; "human" shows a window.
        render_fps: frames a second that "human" holds to [1/s].
        camera: the point of view; may be assigned anew between frames.

    Raises:
        DependencyNotInstalled: pygame is missing.
        ValueError: an unknown render mode, or a size or frame rate that is not positive.
    """

    def __init__(
        self,
        *,
        width: int = 720,
        height: int = 480,
        render_mode: str = "rgb_array",
        render_fps: float = 50.0,
        camera: Camera | None = None,
    ) -> None:
        if render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode is {render_mode!r}; choose one of {RENDER_MODES}")
        if width < 1 or height < 1:
            raise ValueError(
                f"a picture of {width} x {height} pixels is empty; make both 1 or more"
            )
        if not render_fps > 0:
            raise ValueError(f"render_fps is {render_fps}; it must be above 0")
        self._pygame = _import_pygame()
        self.width, self.height = width, height
        self.render_mode = render_mode
        self.render_fps = render_fps
        self.camera = Camera() if camera is None else camera
        self._window: Any = None
        self._clock: Any = None
        self._backdrop: tuple[Camera, Any] | None = None
        size = (width * SUPERSAMPLING, height * SUPERSAMPLING)
        self._canvas = self._pygame.Surface(size, depth=32)
        self._picture = self._pygame.Surface((width, height), depth=32)
        self._painter = Painter(self._pygame)
        self._captions = Captions(self._pygame)

    def render(self, drawing: sy.draw.Drawing) -> NDArray[np.uint8] | None:
        """Paint one frame.

        Returns:
            Pixels, shape (height, width, 3), a new array at each call; None in mode "human".
        """
        self._paint(drawing)
        if self.render_mode == "human":
            self._show()
            return None
        pixels = np.frombuffer(self._pygame.image.tobytes(self._picture, "RGB"), np.uint8)
        return pixels.reshape(self.height, self.width, 3).copy()

    def close(self) -> None:
        """Close the window, if one is open. Rendering again opens it again."""
        if self._window is not None:
            self._pygame.display.quit()
            self._window = None
            self._clock = None

    def _show(self) -> None:
        pygame = self._pygame
        # pygame has one display: another renderer may have closed it.
        if self._window is None or pygame.display.get_surface() is not self._window:
            pygame.display.init()
            pygame.display.set_caption("Steelyard")
            self._window = pygame.display.set_mode((self.width, self.height))
            self._clock = pygame.time.Clock()
        self._window.blit(self._picture, (0, 0))
        pygame.event.pump()
        self._clock.tick(self.render_fps)
        pygame.display.flip()

    def _paint(self, drawing: sy.draw.Drawing) -> None:
        canvas = self._canvas
        view = View(self.camera, width=canvas.get_width(), height=canvas.get_height())
        projector = Projector(view, pixel=SUPERSAMPLING)
        drawable = drawable_part(drawing)
        layers: dict[int, list[Shape]] = {}
        for shape in projector.shapes(drawable):
            layers.setdefault(shape.layer, []).append(shape)

        canvas.blit(self._background(), (0, 0))
        for layer in sorted(layer for layer in layers if layer < 0):
            self._painter.paint(canvas, layers[layer])
        if view.eye[1] > 0.0:
            self._painter.cast(canvas, projector.shadows(drawable))
        for layer in sorted(layer for layer in layers if layer >= 0):
            self._painter.paint(canvas, back_to_front(layers[layer]))
        self._pygame.transform.smoothscale(canvas, self._picture.get_size(), self._picture)
        self._write(drawable)

    def _background(self) -> Any:
        """Sky and ground, painted anew only when the camera has moved."""
        if self._backdrop is None or self._backdrop[0] != self.camera:
            pixels = backdrop(View(self.camera, width=self.width, height=self.height))
            small = self._pygame.surfarray.make_surface(pixels.transpose(1, 0, 2))
            large = self._pygame.transform.scale(small, self._canvas.get_size())
            self._backdrop = self.camera, large
        return self._backdrop[1]

    def _write(self, drawable: Drawable) -> None:
        """Labels at their places, the panel, and in it how much could not be drawn."""
        view = View(self.camera, width=self.width, height=self.height)
        rows: list[Row] = []
        for text in drawable.texts:
            row = Row(text.label, text.value, text.color)
            if text.position is None:
                rows.append(row)
                continue
            point = view.from_world(np.array([text.position]))
            if point[0, 2] > view.near:
                x, y = view.to_pixels(point)[0].tolist()
                self._captions.label(self._picture, row, x, y)
        if drawable.missing:
            rows.append(Row("not finite", str(drawable.missing), WARNING))
        self._captions.panel(self._picture, rows)


def _import_pygame() -> Any:
    os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
    try:
        import pygame
    except ImportError as error:
        raise DependencyNotInstalled(
            'pygame is not installed and rendering needs it; run `pip install "steelyard[render]"`'
        ) from error
    return pygame
