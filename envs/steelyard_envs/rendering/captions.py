"""Text on the picture: the panel in the top left corner, and labels in the world."""

from __future__ import annotations

from typing import Any, NamedTuple

from .patches import Color

PANEL = (252, 251, 248, 214)
MUTED = (104, 114, 124)
CORNER, PADDING, ROW_HEIGHT, GAP, ROUNDING = 14, 11, 19, 18, 8
TEXT_SIZE = 20
# Panel widths are rounded up to this [px], or it would twitch whenever a digit comes or goes.
WIDTH_STEP = 24


class Row(NamedTuple):
    """A label, its value, and the colour of the value."""

    label: str
    value: str
    color: Color


class Captions:
    """Writes with the font that comes with pygame, so no system font is needed."""

    def __init__(self, pygame: Any) -> None:
        self._pygame = pygame
        pygame.font.init()
        self._font = pygame.font.Font(None, TEXT_SIZE)
        self._panels: dict[tuple[int, int], Any] = {}

    def panel(self, picture: Any, rows: list[Row]) -> None:
        """Write rows in the top left corner: labels to the left, values to the right."""
        if not rows:
            return
        written = [
            (
                self._font.render(row.label, True, MUTED if row.value else row.color[:3]),
                self._font.render(row.value, True, row.color[:3]),
            )
            for row in rows
        ]
        widest = max(
            a.get_width() + (GAP + b.get_width() if row.value else 0)
            for row, (a, b) in zip(rows, written, strict=True)
        )
        width = -(-(widest + 2 * PADDING) // WIDTH_STEP) * WIDTH_STEP
        height = len(rows) * ROW_HEIGHT + 2 * PADDING - (ROW_HEIGHT - self._font.get_height())
        picture.blit(self._panel(width, height), (CORNER, CORNER))
        for index, (label, value) in enumerate(written):
            top = CORNER + PADDING + index * ROW_HEIGHT
            picture.blit(label, (CORNER + PADDING, top))
            picture.blit(value, (CORNER + width - PADDING - value.get_width(), top))

    def label(self, picture: Any, row: Row, x: float, y: float) -> None:
        """Write a label centred on a pixel, unless that is outside the picture."""
        if not picture.get_rect().collidepoint(x, y):
            return
        text = f"{row.label} {row.value}".strip()
        ink = self._font.render(text, True, row.color[:3])
        corner = (round(x - 0.5 * ink.get_width()), round(y - 0.5 * ink.get_height()))
        picture.blit(ink, corner)

    def _panel(self, width: int, height: int) -> Any:
        """A translucent box with smooth round corners."""
        if (width, height) not in self._panels:
            pygame = self._pygame
            large = pygame.Surface((4 * width, 4 * height), pygame.SRCALPHA, 32)
            large.fill((*PANEL[:3], 0))
            pygame.draw.rect(large, PANEL, large.get_rect(), border_radius=4 * ROUNDING)
            self._panels[width, height] = pygame.transform.smoothscale(large, (width, height))
        return self._panels[width, height]
