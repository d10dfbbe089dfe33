"""Colours that mean the same thing in every picture, as (red, green, blue), 0 to 255."""

INK = (38, 50, 62)
STEEL = (96, 112, 128)
TIMBER = (214, 170, 118)
DECK = (70, 142, 160)
ROPE = (92, 84, 78)
NODE = (238, 240, 242)
LOAD = (238, 122, 66)
TARGET = (206, 62, 68)
SHOT = (52, 60, 72)
WIND = (62, 124, 196)
CONTACT = (228, 176, 40)
EARTH = (150, 152, 146)
