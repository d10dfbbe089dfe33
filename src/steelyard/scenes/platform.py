"""The T-shaped platform on two feet."""

from __future__ import annotations

from itertools import combinations

from ..scene.contacts import Ground
from ..scene.links import Rod
from ..scene.particle import Particle
from ..scene.rider import Rider
from ..scene.scene import Scene
from .loads import bilinear_weights

FEET = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0))
DECK = ((-3.0, 2.0, -1.0), (-3.0, 2.0, 1.0), (4.0, 2.0, -1.0), (4.0, 2.0, 1.0))


def platform(
    *,
    load: float = 10.0,
    place: tuple[float, float] = (0.4, 0.5),
    damping: float = 0.9,
    friction: float = 0.8,
    restitution: float = 0.2,
) -> Scene:
    """Two feet and four deck corners of 1 kg, all joined by rods; a load rides on the deck.

    The deck spans x from -3 to 4 m and z from -1 to 1 m at a height of 2 m, the feet stand at x = 0. With
    the load at 0.4 of the deck's length it balances, and is unstable there. The particles are the feet,
    then the deck in the order of ``bilinear_weights``, then the load.

    Args:
        load: mass of the rider [kg]; 0 for none.
        place: where it starts on the deck, each in [0, 1].
        damping: share of velocity that particles keep per second.
        friction: Coulomb coefficient of the ground under the feet.
        restitution: of the feet on the ground.
    """
    scene = Scene()
    particles = [scene.add(Particle(position=x, damping=damping)) for x in (*FEET, *DECK)]
    for a, b in combinations(particles, 2):
        scene.add(Rod(a, b))
    scene.add(Ground(friction=friction, restitution=restitution, particles=particles[:2]))
    if load > 0.0:
        weights = bilinear_weights(*place)
        position = weights @ DECK
        rider = scene.add(Particle(position=position, mass=load, damping=damping))
        scene.add(Rider(rider, particles[2:6], weights))
    return scene
