"""Shapes put on a pygame surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .patches import Color, Disc, Polygon, bounds
from .shapes import Shape

# What a shadow takes away from the colour of the ground.
SHADOW = np.array([58, 55, 50], np.float32)
# Shadows are painted this much smaller and scaled up again.
SHADOW_SHRINK = 4
# Half of the length over which the edge of a shadow runs out, in pixels of the small one.
SHADOW_BLUR = 3


class Painter:
    """Paints shapes and shadows on surfaces of pygame, which needs no display for it."""

    def __init__(self, pygame: Any) -> None:
        self._pygame = pygame

    def paint(self, surface: Any, shapes: list[Shape]) -> None:
        """Paint shapes in the order given."""
        for shape in shapes:
            alpha = _alpha(shape.patches[0].color)
            if alpha == 255:
                for patch in shape.patches:
                    self._patch(surface, patch, patch.color[:3])
            elif alpha > 0:
                self._glaze(surface, shape, alpha)

    def cast(self, surface: Any, outlines: list[Polygon]) -> None:
        """Darken a surface where shadows fall; where two overlap it is no darker."""
        if not outlines:
            return
        pygame = self._pygame
        room = 2 * SHADOW_BLUR * SHADOW_SHRINK
        box = self._box(outlines).inflate(2 * room, 2 * room).clip(surface.get_rect())
        if box.width == 0 or box.height == 0:
            return
        size = (box.width // SHADOW_SHRINK + 1, box.height // SHADOW_SHRINK + 1)
        mask = pygame.Surface((2 * size[0], 2 * size[1]), depth=32)
        scale = np.array(mask.get_size()) / box.size
        for outline in outlines:
            points = (outline.points - box.topleft) * scale
            pygame.draw.polygon(mask, (255, 255, 255), points.tolist())
        small = pygame.surfarray.array_red(pygame.transform.smoothscale(mask, size))
        cover = _blur(_blur(small / np.float32(255.0)))
        shadow = pygame.surfarray.make_surface((cover[:, :, None] * SHADOW).astype(np.uint8))
        shadow = pygame.transform.smoothscale(shadow, box.size)
        surface.blit(shadow, box.topleft, special_flags=pygame.BLEND_RGB_SUB)

    def _box(self, patches: Sequence[Polygon | Disc]) -> Any:
        """The pixels that patches can touch."""
        left, top, right, bottom = bounds(patches)
        return self._pygame.Rect(
            math.floor(left) - 1,
            math.floor(top) - 1,
            math.ceil(right - left) + 3,
            math.ceil(bottom - top) + 3,
        )

    def _patch(self, surface: Any, patch: Polygon | Disc, color: Color) -> None:
        draw = self._pygame.draw
        if isinstance(patch, Disc):
            draw.circle(surface, color, (patch.x, patch.y), patch.radius)
        else:
            draw.polygon(surface, color, patch.points.tolist())

    def _glaze(self, surface: Any, shape: Shape, alpha: int) -> None:
        """Paint a translucent shape as a whole, so that patches that overlap do not show."""
        pygame = self._pygame
        box = self._box(shape.patches).clip(surface.get_rect())
        if box.width == 0 or box.height == 0:
            return
        layer = pygame.Surface(box.size, pygame.SRCALPHA, 32)
        for patch in shape.patches:
            moved = patch.moved(-box.left, -box.top)
            self._patch(layer, moved, (*patch.color[:3], 255))
        layer.set_alpha(alpha)
        surface.blit(layer, box.topleft)


def _alpha(color: Color) -> int:
    return color[3] if len(color) == 4 else 255


def _blur(cover: NDArray[np.float32]) -> NDArray[np.float32]:
    """Each value replaced by the mean over a square around it; the margin repeats the rim."""
    span = 2 * SHADOW_BLUR + 1
    for _ in range(2):
        padded = np.pad(cover, ((SHADOW_BLUR + 1, SHADOW_BLUR), (0, 0)), mode="edge")
        sums = np.cumsum(padded, axis=0, dtype=np.float32)
        cover = ((sums[span:] - sums[:-span]).T / np.float32(span)).astype(np.float32)
    return cover
