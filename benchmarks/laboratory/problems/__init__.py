"""The reference problems, a file each."""

from __future__ import annotations

from importlib import import_module

from benchmarks.laboratory.problem import Problem

NAMES = (
    "projectile",
    "spring",
    "bungee",
    "net",
    "buoyancy",
    "pendulum",
    "triple_pendulum",
    "chain",
    "platform",
    "top",
    "bridge",
    "catenary",
    "cloth",
    "collision",
    "bouncing_ball",
    "contact",
)


def load(name: str) -> tuple[Problem, ...]:
    """The variants of a problem."""
    variants: tuple[Problem, ...] = import_module(f"{__name__}.{name}").problems()
    return variants
