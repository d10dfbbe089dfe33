"""Sweeps over the contacts and joints of an island: one after the other, or the worst first.

Impulses are summed per row and clamped as sums, friction to the disc that the normal impulse at hand allows. A row of
compliance R moves by (wanted - u - R l)/(w + R), w what a unit impulse along it does to its velocity u; three rows that
hold a joint's place, or its turn, are solved together.
"""

from __future__ import annotations

from math import sqrt

from ..constraints.brakes import brake_mobility, has_brake, limit_brake, relative_spin
from ..constraints.contact_rows import (
    contact_at,
    contact_ends,
    length,
    relative_velocity,
    world_vector,
)
from ..constraints.joint_rows import joint_at, joint_solids, row_at
from ..constraints.solids import symmetric_times
from ..constraints.wide_rows import (
    load_velocity,
    moved,
    response_along,
    store_velocity,
    velocity_along,
)
from ..kernel import inner
from ..math.pointers import doubles_at
from ..model.rigid_layout import (
    C_ARM_A,
    C_ARM_B,
    C_BEFORE,
    C_BINORMAL,
    C_BRAKE,
    C_BRAKE_BEFORE,
    C_BRAKE_SPEED,
    C_COMPLIANCE,
    C_DERIVATIVE,
    C_FRICTION,
    C_HELD,
    C_IMPULSE,
    C_LEAST,
    C_LIMIT,
    C_NORMAL,
    C_TANGENT,
    EQUAL,
    HELD,
    ISLAND,
    J_BEFORE,
    J_BLOCK,
    J_COMPLIANCE,
    J_HIGH,
    J_IMPULSE,
    J_KIND,
    J_LEAST,
    J_LOW,
    J_STEP,
    J_WEIGHT,
    LIST,
    N_SWEEPS,
    N_WORST,
    NUMBERS,
    OFF,
    ROW_ENTRIES,
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_VELOCITY,
    SETTLED,
)
from ..model.tape import H_RIGID
from ..stage import stage
from .rigid_islands import PUSH, begin_velocity, forget_impulses, island_at_hand

# Sweeps of a single contact, and the change, over its impulse, at which it stands still.
_SETTLING, _SETTLED = 40, 4e-16
# Share of the product of their mobilities from which three rows count as independent.
_APART = 1e-9


@inner
def _moment(s, c, arm, direction):
    """Moment of a unit impulse at a contact along one of its directions."""
    nx = s[c + direction]
    ny = s[c + direction + 1]
    nz = s[c + direction + 2]
    return (
        s[c + arm + 1] * nz - s[c + arm + 2] * ny,
        s[c + arm + 2] * nx - s[c + arm] * nz,
        s[c + arm] * ny - s[c + arm + 1] * nx,
    )


@inner
def mobility_along(s, c, solid, arm, direction):
    """What a unit impulse at a contact does to the velocity along its direction there, on one solid."""
    x, y, z = _moment(s, c, arm, direction)
    a, b, d = symmetric_times(s, solid + S_INVERSE_INERTIA, x, y, z)
    return s[solid + S_INVERSE] + a * x + b * y + d * z


@inner
def _mobility_across(s, c, solid, arm):
    """What a unit impulse along one tangent does to the velocity along the other."""
    x, y, z = _moment(s, c, arm, C_TANGENT)
    a, b, d = symmetric_times(s, solid + S_INVERSE_INERTIA, x, y, z)
    x, y, z = _moment(s, c, arm, C_BINORMAL)
    return a * x + b * y + d * z


@inner
def _move(s, solid, fx, fy, fz, tx, ty, tz):
    """Change a solid's velocities by an impulse and its moment."""
    v = solid + S_VELOCITY
    inverse = s[solid + S_INVERSE]
    s[v] += inverse * fx
    s[v + 1] += inverse * fy
    s[v + 2] += inverse * fz
    a, b, c = symmetric_times(s, solid + S_INVERSE_INERTIA, tx, ty, tz)
    s[v + 3] += a
    s[v + 4] += b
    s[v + 5] += c


@inner
def _push(s, c, a, b, n, t, u):
    """Change the velocities of both solids by an impulse along normal and tangents."""
    fx, fy, fz = world_vector(s, c, n, t, u)
    x = s[c + C_ARM_A]
    y = s[c + C_ARM_A + 1]
    z = s[c + C_ARM_A + 2]
    _move(s, a, fx, fy, fz, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)
    if b >= 0:
        x = s[c + C_ARM_B]
        y = s[c + C_ARM_B + 1]
        z = s[c + C_ARM_B + 2]
        _move(s, b, -fx, -fy, -fz, z * fy - y * fz, x * fz - z * fx, y * fx - x * fy)


@inner
def _begin_contact(s, c, a, b):
    """Impulses of the stage before, and mobilities of a contact."""
    for k in range(3):
        s[c + C_IMPULSE + k] = s[c + C_BEFORE + k]
        direction = C_NORMAL if k == 0 else (C_TANGENT if k == 1 else C_BINORMAL)
        mobility = mobility_along(s, c, a, C_ARM_A, direction)
        if b >= 0:
            mobility += mobility_along(s, c, b, C_ARM_B, direction)
        s[c + C_DERIVATIVE + k] = mobility
    across = _mobility_across(s, c, a, C_ARM_A)
    if b >= 0:
        across += _mobility_across(s, c, b, C_ARM_B)
    # One for both tangents, the largest in their plane: with one each, friction would not be along the slip.
    mean = 0.5 * (s[c + C_DERIVATIVE + 1] + s[c + C_DERIVATIVE + 2])
    half = 0.5 * (s[c + C_DERIVATIVE + 1] - s[c + C_DERIVATIVE + 2])
    s[c + C_DERIVATIVE + 1] = mean + sqrt(half * half + across * across)
    # So far over the mobility.
    s[c + C_COMPLIANCE] *= s[c + C_DERIVATIVE]


@inner
def _begin_block(s, row):
    """Inverse of what unit impulses along three rows that are held do to each other, if they can be solved together."""
    second = row + ROW_ENTRIES
    third = second + ROW_ENTRIES
    if s[row + J_KIND] == EQUAL and s[second + J_KIND] == EQUAL and s[third + J_KIND] == EQUAL:
        xx = s[row + J_WEIGHT] + s[row + J_COMPLIANCE]
        yy = s[second + J_WEIGHT] + s[second + J_COMPLIANCE]
        zz = s[third + J_WEIGHT] + s[third + J_COMPLIANCE]
        yx = response_along(s, row, second)
        zx = response_along(s, row, third)
        zy = response_along(s, second, third)
        cxx = yy * zz - zy * zy
        cyx = zy * zx - yx * zz
        czx = yx * zy - yy * zx
        determinant = xx * cxx + yx * cyx + zx * czx
        if determinant > _APART * xx * yy * zz:
            share = 1.0 / determinant
            s[row + J_BLOCK] = share * cxx
            s[row + J_BLOCK + 1] = share * cyx
            s[row + J_BLOCK + 2] = share * (xx * zz - zx * zx)
            s[row + J_BLOCK + 3] = share * czx
            s[row + J_BLOCK + 4] = share * (yx * zx - xx * zy)
            s[row + J_BLOCK + 5] = share * (xx * yy - yx * yx)


@inner
def _begin_joint(tape, s, rigid, joint):
    """Impulses of the stage before, and which neighbours of a joint's rows are solved together."""
    first = row_at(tape, rigid, tape[joint + 4])
    count = tape[joint + 5]
    row = first
    for _ in range(count):
        s[row + J_IMPULSE] = s[row + J_BEFORE]
        s[row + J_BLOCK] = 0.0
        if s[row + J_KIND] != OFF:
            s[row + J_STEP] = 1.0 / (s[row + J_WEIGHT] + s[row + J_COMPLIANCE])
        row += ROW_ENTRIES
    for k in range(0, count - 2, 3):
        _begin_block(s, first + ROW_ENTRIES * k)


@inner
def _begin(tape, s, n, rigid, contacts, joints):
    """Impulses of the stage before, and rows."""
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        _begin_contact(s, c, a, b)
        if has_brake(s, c):
            _begin_brake(s, c, a, b)
    for j in range(joints):
        _begin_joint(tape, s, rigid, joint_at(tape, rigid, n[tape[rigid + HELD] + j]))


@inner
def _begin_brake(s, c, a, b):
    """The same of spinning and rolling: mobilities about the normal, and about both tangents together."""
    for k in range(3):
        s[c + C_BRAKE + k] = s[c + C_BRAKE_BEFORE + k]
    s[c + C_BRAKE_SPEED] = brake_mobility(s, c, a, b, C_NORMAL)
    one = brake_mobility(s, c, a, b, C_TANGENT)
    # At most the sum, and for a ball twice too much, which takes sweeps alone.
    s[c + C_BRAKE_SPEED + 1] = one + brake_mobility(s, c, a, b, C_BINORMAL)


@inner
def _sweep_brake(s, c, a, b):
    """Spinning and rolling of one contact."""
    s[c + C_LIMIT] = s[c + C_IMPULSE] + s[c + C_HELD]
    n = s[c + C_BRAKE]
    t = s[c + C_BRAKE + 1]
    u = s[c + C_BRAKE + 2]
    w0, w1, w2 = relative_spin(s, c, a, b, S_VELOCITY)
    across = s[c + C_BRAKE_SPEED + 1]
    l0, l1, l2 = limit_brake(s, c, n - w0 / s[c + C_BRAKE_SPEED], t - w1 / across, u - w2 / across)
    s[c + C_BRAKE] = l0
    s[c + C_BRAKE + 1] = l1
    s[c + C_BRAKE + 2] = l2
    x, y, z = world_vector(s, c, l0 - n, l1 - t, l2 - u)
    _move(s, a, 0.0, 0.0, 0.0, x, y, z)
    if b >= 0:
        _move(s, b, 0.0, 0.0, 0.0, -x, -y, -z)


@inner
def _normal_change(s, c, u):
    """Change of a contact's normal impulse at a normal velocity."""
    give = s[c + C_COMPLIANCE]
    before = s[c + C_IMPULSE]
    after = before + (s[c + C_LEAST] - u - give * before) / (s[c + C_DERIVATIVE] + give)
    return max(after, 0.0) - before


@inner
def _sweep_contact(s, c, a, b):
    """Normal impulse, then friction, of one contact."""
    u0, _, _ = relative_velocity(s, c, a, b, S_VELOCITY)
    change = _normal_change(s, c, u0)
    if change != 0.0:
        s[c + C_IMPULSE] += change
        _push(s, c, a, b, change, 0.0, 0.0)
    most = s[c + C_FRICTION] * (s[c + C_IMPULSE] + s[c + C_HELD])
    l1 = s[c + C_IMPULSE + 1]
    l2 = s[c + C_IMPULSE + 2]
    if most > 0.0 or l1 != 0.0 or l2 != 0.0:
        _, u1, u2 = relative_velocity(s, c, a, b, S_VELOCITY)
        t1 = l1 - u1 / s[c + C_DERIVATIVE + 1]
        t2 = l2 - u2 / s[c + C_DERIVATIVE + 1]
        size = sqrt(t1 * t1 + t2 * t2)
        if size > most:
            share = most / size
            t1 *= share
            t2 *= share
        s[c + C_IMPULSE + 1] = t1
        s[c + C_IMPULSE + 2] = t2
        _push(s, c, a, b, 0.0, t1 - l1, t2 - l2)
    if has_brake(s, c):
        _sweep_brake(s, c, a, b)


@inner
def _row_change(s, row, va, vb):
    """Change of the impulse along a joint's row."""
    before = s[row + J_IMPULSE]
    rest = before + s[row + J_STEP] * (s[row + J_LEAST] - s[row + J_COMPLIANCE] * before)
    after = rest - s[row + J_STEP] * velocity_along(s, row, va, vb)
    return min(max(after, s[row + J_LOW]), s[row + J_HIGH]) - before


@inner
def _sweep_row(s, row, a, b):
    """One row of a joint."""
    va = load_velocity(s, a)
    vb = load_velocity(s, b)
    change = _row_change(s, row, va, vb)
    s[row + J_IMPULSE] += change
    va, vb = moved(s, row, va, vb, change)
    store_velocity(s, a, va)
    store_velocity(s, b, vb)


@inner
def _missing(s, row, va, vb):
    """Velocity along a row that is held which is still wanted."""
    held = s[row + J_COMPLIANCE] * s[row + J_IMPULSE]
    return s[row + J_LEAST] - held - velocity_along(s, row, va, vb)


@inner
def _sweep_block(s, row, a, b):
    """Three rows of a joint that are held, at once."""
    second = row + ROW_ENTRIES
    third = second + ROW_ENTRIES
    va = load_velocity(s, a)
    vb = load_velocity(s, b)
    x, y, z = symmetric_times(
        s, row + J_BLOCK, _missing(s, row, va, vb), _missing(s, second, va, vb), _missing(s, third, va, vb)
    )  # fmt: skip
    s[row + J_IMPULSE] += x
    s[second + J_IMPULSE] += y
    s[third + J_IMPULSE] += z
    va, vb = moved(s, row, va, vb, x)
    va, vb = moved(s, second, va, vb, y)
    va, vb = moved(s, third, va, vb, z)
    store_velocity(s, a, va)
    store_velocity(s, b, vb)


@inner
def _sweep(tape, s, n, rigid, contacts, joints):
    """All joints, then all contacts, once."""
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        end = row + ROW_ENTRIES * tape[joint + 5]
        while row < end:
            if s[row + J_BLOCK] != 0.0:
                _sweep_block(s, row, a, b)
                row += 2 * ROW_ENTRIES
            elif s[row + J_KIND] != OFF:
                _sweep_row(s, row, a, b)
            row += ROW_ENTRIES
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        a, b = contact_ends(tape, n, rigid, i)
        _sweep_contact(s, contact_at(tape, rigid, i), a, b)


@inner
def _mend_worst(tape, s, n, rigid, contacts, joints):
    """The contact, or the row of a joint, whose velocity is furthest from what it must be; whether there was one."""
    worst = 0.0
    found = -1
    found_row = -1
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] != OFF:
                change = _row_change(s, row, load_velocity(s, a), load_velocity(s, b))
                off = abs(change) * s[row + J_WEIGHT]
                if off > worst:
                    worst = off
                    found = n[tape[rigid + HELD] + j]
                    found_row = row
            row += ROW_ENTRIES
    contact = -1
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        u0, _, _ = relative_velocity(s, c, a, b, S_VELOCITY)
        off = abs(_normal_change(s, c, u0)) * s[c + C_DERIVATIVE]
        if off > worst:
            worst = off
            contact = i
    if contact >= 0:
        a, b = contact_ends(tape, n, rigid, contact)
        _sweep_contact(s, contact_at(tape, rigid, contact), a, b)
    elif found >= 0:
        a, b = joint_solids(tape, rigid, joint_at(tape, rigid, found))
        _sweep_row(s, found_row, a, b)
    return contact >= 0 or found >= 0


@inner
def settle_contact(tape, s, n, rigid):
    """Sweep an island's only contact until its impulse stands still: Coulomb's law to rounding; whether it did."""
    i = n[tape[rigid + LIST]]
    c = contact_at(tape, rigid, i)
    a, b = contact_ends(tape, n, rigid, i)
    s[c + C_COMPLIANCE] = 0.0
    _begin(tape, s, n, rigid, 1, 0)
    for _ in range(_SETTLING):
        l0, l1, l2 = s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2]
        b0, b1, b2 = s[c + C_BRAKE], s[c + C_BRAKE + 1], s[c + C_BRAKE + 2]
        _sweep_contact(s, c, a, b)
        change = length(s[c + C_IMPULSE] - l0, s[c + C_IMPULSE + 1] - l1, s[c + C_IMPULSE + 2] - l2)
        size = length(s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2])
        t = c + C_BRAKE
        braked = length(s[t] - b0, s[t + 1] - b1, s[t + 2] - b2)
        still = not has_brake(s, c) or braked <= _SETTLED * length(s[t], s[t + 1], s[t + 2])
        if change <= _SETTLED * size and still:
            return True
    return False


@stage
def sweep_island(tape, s, n, what):
    """The island at hand, by sweeps that begin with the impulses of the stage before, or for a push with none."""
    rigid = tape[H_RIGID]
    numbers = doubles_at(tape[rigid + NUMBERS])
    size, contacts, joints, _ = island_at_hand(tape, n, rigid)
    if what == PUSH:
        forget_impulses(tape, s, n, rigid, contacts, joints, 0.0)
    begin_velocity(tape, s, n, rigid, size, contacts, joints, what != PUSH)
    sweeps = int(numbers[N_SWEEPS])
    _begin(tape, s, n, rigid, contacts, joints)
    if numbers[N_WORST] == 0.0:
        for _ in range(sweeps):
            _sweep(tape, s, n, rigid, contacts, joints)
    else:
        # Contacts in turn once in the end, for friction where nothing closes.
        turns = sweeps * (contacts + joints) if numbers[N_WORST] == 2.0 else sweeps
        for _ in range(turns):
            if not _mend_worst(tape, s, n, rigid, contacts, joints):
                break
        _sweep(tape, s, n, rigid, contacts, joints)
    n[tape[rigid + ISLAND] + SETTLED] = 1
