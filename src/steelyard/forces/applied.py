"""Forces on bodies that control sets: a wrench along the world's axes, and thrusters fixed in bodies.

Records: of a wrench, the rows that sum forces at the centre of mass, the body's torque, and the force and torque; of a
thruster, the body's orientation, the force of its point, its direction in the body's frame, its greatest force and the
row of its throttle.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import load, splat
from ..math.rotations import load_turn, rotate
from ..math.vectors import add_scaled, load_vector
from ..model.tape import H_APPLIED, H_THRUSTS

APPLIED, THRUST = 3, 5


@inner
def add_applied(tape, s):
    """Add every applied wrench."""
    one = splat(1.0)
    at = tape[H_APPLIED]
    for index in range(tape[at]):
        k = at + 1 + APPLIED * index
        for half in range(2):
            add_scaled(s, tape[k + half], one, *load_vector(s, tape[k + 2] + 3 * half))


@inner
def add_thrusts(tape, s):
    """Add every thruster's force to its point."""
    at = tape[H_THRUSTS]
    for index in range(tape[at]):
        k = at + 1 + THRUST * index
        f, w, x, y, z = load_turn(s, tape[k])
        push = load(s, tape[k + 3]) * load(s, tape[k + 4])
        add_scaled(s, tape[k + 1], push, *rotate(f, w, x, y, z, *load_vector(s, tape[k + 2])))
