"""Contact geometry: normal and gap of every pair that may touch, at the start of a step."""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, select, splat, sqrt, store
from ..math.vectors import dot, load_vector, store_vector
from ..model.tape import BALLS, CONTACT, GROUND, H_CONTACTS, LINE


@inner
def _ground(s, contact, tape):
    """Half-space: gap = n . x - height - radius."""
    x = tape[contact + 1]
    plane = tape[contact + 11]
    frame = tape[contact + 16]
    gap = -load(s, plane + 3) - load(s, tape[contact + 12])
    for component in range(3):
        normal = load(s, plane + component)
        store(s, frame + component, normal)
        gap = fma(normal, load(s, x + component), gap)
    store(s, tape[contact + 17], gap)


@inner
def _line(s, contact, tape):
    """Segment: from the nearest point of the line to the particle; up where they coincide."""
    zero = splat(0.0)
    one = splat(1.0)
    x = tape[contact + 1]
    line = tape[contact + 11]
    frame = tape[contact + 16]
    ax = load(s, line + 3) - load(s, line)
    ay = load(s, line + 4) - load(s, line + 1)
    az = load(s, line + 5) - load(s, line + 2)
    px = load(s, x) - load(s, line)
    py = load(s, x + 1) - load(s, line + 1)
    pz = load(s, x + 2) - load(s, line + 2)
    along = fma(pz, az, fma(py, ay, px * ax)) / fma(az, az, fma(ay, ay, ax * ax))
    along = select(along > zero, along, zero)
    along = select(along < one, along, one)
    dx = px - along * ax
    dy = py - along * ay
    dz = pz - along * az
    distance = sqrt(fma(dz, dz, fma(dy, dy, dx * dx)))
    apart = distance > zero
    store(s, frame, select(apart, dx / distance, zero))
    store(s, frame + 1, select(apart, dy / distance, one))
    store(s, frame + 2, select(apart, dz / distance, zero))
    store(s, tape[contact + 17], distance - load(s, line + 6) - load(s, tape[contact + 12]))


@inner
def _balls(s, contact, tape):
    """Two balls: from the second to the first; up where they coincide."""
    zero = splat(0.0)
    ax, ay, az = load_vector(s, tape[contact + 1])
    bx, by, bz = load_vector(s, tape[contact + 2])
    x = ax - bx
    y = ay - by
    z = az - bz
    distance = sqrt(dot(x, y, z, x, y, z))
    apart = distance > zero
    inverse = splat(1.0) / select(apart, distance, splat(1.0))
    up = select(apart, y * inverse, splat(1.0))
    store_vector(s, tape[contact + 16], x * inverse, up, z * inverse)
    reach = load(s, tape[contact + 11]) + load(s, tape[contact + 12])
    store(s, tape[contact + 17], distance - reach)


@inner
def _user(s, contact, tape):
    """Written by the user: normal and penetration lie in the state; 0 or less is no contact."""
    given = tape[contact + 11]
    frame = tape[contact + 16]
    for component in range(3):
        store(s, frame + component, load(s, given + component))
    depth = load(s, given + 3)
    far = splat(1e9)
    store(s, tape[contact + 17], select(depth > splat(0.0), -depth, far))


@inner
def _tangents(s, frame):
    """Complete the frame with two tangents (Duff et al. 2017, eq. 3), continuous except at n_z = 0."""
    zero = splat(0.0)
    one = splat(1.0)
    nx = load(s, frame)
    ny = load(s, frame + 1)
    nz = load(s, frame + 2)
    sign = select(nz < zero, -one, one)
    a = -one / (sign + nz)
    b = nx * ny * a
    store(s, frame + 3, one + sign * nx * nx * a)
    store(s, frame + 4, sign * b)
    store(s, frame + 5, -sign * nx)
    store(s, frame + 6, b)
    store(s, frame + 7, sign + ny * ny * a)
    store(s, frame + 8, -ny)


@inner
def contact_geometry(tape, s):
    """Frame (normal, two tangents) and gap of every contact at the current positions."""
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        kind = tape[contact]
        if kind == GROUND:
            _ground(s, contact, tape)
        elif kind == LINE:
            _line(s, contact, tape)
        elif kind == BALLS:
            _balls(s, contact, tape)
        else:
            _user(s, contact, tape)
        _tangents(s, tape[contact + 16])
