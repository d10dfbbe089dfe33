"""What a refusal must say, and a scene with one of everything to be refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import steelyard as sy

REFUSALS = (ValueError, TypeError, MemoryError)
ORIGIN = (0, 0, 0)


@contextmanager
def refused(*words: object, kind: Any = REFUSALS) -> Iterator[None]:
    """Expect a refusal that names all ``words`` and then says what to do.

    A message states what is wrong and then the remedy, so it has at least two parts, divided by a
    full stop or a semicolon.
    """
    with pytest.raises(kind) as caught:
        yield
    message = str(caught.value)
    missing = [str(word) for word in words if str(word) not in message]
    assert not missing, f"{message!r} does not name {missing}"
    assert re.search(r"[.;] \S", message), f"{message!r} has no remedy"


def pair(**settings: Any) -> tuple[sy.Scene, sy.Particle, sy.Particle]:
    """A scene of two particles one metre apart."""
    scene = sy.Scene()
    a = scene.add(sy.Particle(position=(0, 2, 0), **settings))
    b = scene.add(sy.Particle(position=(1, 2, 0), radius=0.1))
    return scene, a, b


def no_contact(x: Any, y: Any, t: Any) -> Any:
    """A contact generator that finds none."""
    return np.zeros(x.shape), np.zeros(x.shape[:2])


def no_force(x: Any, v: Any, t: Any) -> Any:
    """A user force of zero."""
    return np.zeros(x.shape)


def things(a: sy.Particle, b: sy.Particle) -> list[Any]:
    """One of every kind that refers to particles, on a or on both."""
    some = [a, b]
    return [
        sy.Rod(a, b),
        sy.Rod(b, a),
        sy.RodConstraint(a, (0, 5, 0)),
        sy.Cable(a, b, 1.0),
        sy.CableConstraint(a, (0, 5, 0), 1.0),
        sy.Rider(b, [a]),
        sy.Ground(particles=some),
        sy.LinePlatform(start=ORIGIN, end=(1, 0, 0), radius=0.1, particles=some),
        sy.Collisions(particles=some),
        sy.ContactGenerator(no_contact, [(b, a)]),
        sy.ContactGenerator(no_contact, [(a, None)]),
        sy.Gravity((0, 1, 0), particles=some),
        sy.Drag(linear=1.0, particles=some),
        sy.Spring(b, a, 1.0, 1.0),
        sy.Bungee(a, b, 1.0, 1.0),
        sy.AnchoredSpring(a, ORIGIN, 1.0, 1.0),
        sy.AnchoredBungee(a, ORIGIN, 1.0, 1.0),
        sy.StiffSpring(a, ORIGIN, 1.0),
        sy.Buoyancy(a, 0.0, 1.0, 1.0),
        sy.Explosion(place=ORIGIN, wave_force=1.0, particles=some),
        sy.UserForce(no_force, particles=some),
    ]
