"""Points of bodies: where forces act on a body as on a particle, and the wrench that they come to.

A point has rows of its own for position, velocity and force, so springs, floats, surfaces and thrusters need not know
what they act on. Record: body's position, orientation, velocity, angular velocity and wrench, place in the body's
frame, then the point's position, velocity and force. A wrench is a force and a torque about the centre of mass; the
record of one: its rows, the body's orientation, angular momentum and inverse inertia, and the rows of its angular
velocity.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import splat, store
from ..math.rotations import in_frame, load_turn, rotate
from ..math.vectors import add_scaled, between, cross, load_vector, store_vector
from ..model.tape import BODY_POINT, H_POINTS, H_WRENCHED, WRENCHED


@inner
def clear_wrenches(tape, s):
    """Wrench rows = 0, and the angular velocities of the bodies that they act on."""
    zero = splat(0.0)
    at = tape[H_WRENCHED]
    for index in range(tape[at]):
        k = at + 1 + WRENCHED * index
        for row in range(6):
            store(s, tape[k] + row, zero)
        f, w, x, y, z = load_turn(s, tape[k + 1])
        spin = in_frame(s, tape[k + 3], f, w, x, y, z, *load_vector(s, tape[k + 2]))
        store_vector(s, tape[k + 4], *spin)


@inner
def place_points(tape, s):
    """Positions x + R r and velocities v + w x R r of all points; their forces = 0."""
    zero = splat(0.0)
    at = tape[H_POINTS]
    for index in range(tape[at]):
        point = at + 1 + BODY_POINT * index
        f, w, x, y, z = load_turn(s, tape[point + 1])
        rx, ry, rz = rotate(f, w, x, y, z, *load_vector(s, tape[point + 5]))
        px, py, pz = load_vector(s, tape[point])
        store_vector(s, tape[point + 6], px + rx, py + ry, pz + rz)
        wx, wy, wz = load_vector(s, tape[point + 3])
        cx, cy, cz = cross(wx, wy, wz, rx, ry, rz)
        vx, vy, vz = load_vector(s, tape[point + 2])
        store_vector(s, tape[point + 7], vx + cx, vy + cy, vz + cz)
        store_vector(s, tape[point + 8], zero, zero, zero)


@inner
def gather_points(tape, s):
    """Add the forces of all points to the wrenches of their bodies."""
    one = splat(1.0)
    at = tape[H_POINTS]
    for index in range(tape[at]):
        point = at + 1 + BODY_POINT * index
        fx, fy, fz = load_vector(s, tape[point + 8])
        rx, ry, rz = between(s, tape[point + 6], tape[point])
        add_scaled(s, tape[point + 4], one, fx, fy, fz)
        add_scaled(s, tape[point + 4] + 3, one, *cross(rx, ry, rz, fx, fy, fz))
