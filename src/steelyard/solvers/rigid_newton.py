"""Newton's method for one convex pass of an island: impulses of contacts and joints, the matrix, the line search.

It minimises |v - v*|_M^2/2 + R |l|^2/2 (see ``proximal_newton``); l follows from v.
"""

from __future__ import annotations

from math import sqrt

from ..constraints.brakes import (
    add_torque,
    brake_at,
    brake_derivative,
    has_brake,
    relative_spin,
)
from ..constraints.contact_rows import add_impulse, contact_at, contact_ends, relative_velocity
from ..constraints.joint_rows import (
    add_row_impulse,
    joint_at,
    joint_solids,
    row_at,
    row_impulse,
    row_velocity,
)
from ..constraints.solids import is_free, solid_at, symmetric_times
from ..kernel import inner
from ..math.lanes import fma, load, load_at, splat, store
from ..math.pointers import LANES, offset
from ..model.rigid_layout import (
    C_ARM_A,
    C_ARM_B,
    C_BEFORE,
    C_BINORMAL,
    C_BRAKE,
    C_BRAKE_CHANGE,
    C_BRAKE_SPEED,
    C_CHANGE,
    C_COMPLIANCE,
    C_DERIVATIVE,
    C_FRICTION,
    C_HELD,
    C_IMPULSE,
    C_LEAST,
    C_NORMAL,
    C_SHIFT,
    C_SPEED,
    C_TANGENT,
    END_A,
    END_B,
    EQUAL,
    FIRST,
    HELD,
    HELD_ROW,
    J_CHANGE,
    J_COMPLIANCE,
    J_IMPULSE,
    J_KIND,
    J_SPEED,
    LIST,
    LOCAL,
    MATRIX_ROW,
    OFF,
    ORDER,
    ROW_ENTRIES,
    S_FREE,
    S_GRADIENT,
    S_INERTIA,
    S_INVERSE,
    S_INVERSE_INERTIA,
    S_MASS,
    S_MOMENTUM,
    S_MOVES,
    S_PUSH,
    S_STEP,
    S_TURNS,
    S_VELOCITY,
    STARTS,
    VECTOR_ROW,
    W_B,
)
from .block_cholesky import SIX, clear_rows, factorise, solve_factored
from .friction_cone import project_beyond, projection_derivative

_HALVINGS = 30
# Share of the tolerance at which no step is taken at all.
_UNTOUCHED = 0.01
_FLAT = 1e-3
# Residual that rounding may leave where no step lessens it.
_ROUNDING = 1e-6


@inner
def impulse_at(s, c, u0, u1, u2):
    """Impulse of a contact at a velocity."""
    stiffness = 1.0 / s[c + C_COMPLIANCE]
    yn = s[c + C_BEFORE] + (s[c + C_LEAST] - s[c + C_FRICTION] * s[c + C_SHIFT] - u0) * stiffness
    y1 = s[c + C_BEFORE + 1] - u1 * stiffness
    y2 = s[c + C_BEFORE + 2] - u2 * stiffness
    l0, l1, l2, case, size = project_beyond(yn, y1, y2, s[c + C_FRICTION], s[c + C_HELD])
    return l0, l1, l2, case, size, y1, y2


@inner
def _evaluate(tape, s, n, rigid, size, contacts, joints):
    """Impulses, their derivatives and the gradient at the velocity; its norm and that of the momenta."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_PUSH + k] = 0.0
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        u0, u1, u2 = relative_velocity(s, c, a, b, S_VELOCITY)
        l0, l1, l2, case, reach, y1, y2 = impulse_at(s, c, u0, u1, u2)
        s[c + C_SPEED] = u0
        s[c + C_SPEED + 1] = u1
        s[c + C_SPEED + 2] = u2
        s[c + C_IMPULSE] = l0
        s[c + C_IMPULSE + 1] = l1
        s[c + C_IMPULSE + 2] = l2
        d = projection_derivative(y1, y2, s[c + C_FRICTION], l0 + s[c + C_HELD], case, reach)
        at = c + C_DERIVATIVE
        s[at], s[at + 1], s[at + 2], s[at + 3], s[at + 4], s[at + 5] = d
        add_impulse(s, c, a, b, S_PUSH, l0, l1, l2)
        if has_brake(s, c):
            _evaluate_brake(s, c, a, b)
    for j in range(joints):
        _evaluate_joint(tape, s, rigid, n[tape[rigid + HELD] + j])
    error = 0.0
    scale = 0.0
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        inverse = s[at + S_INVERSE]
        for k in range(3):
            p = s[at + S_MASS] * (s[at + S_VELOCITY + k] - s[at + S_FREE + k])
            g = p - s[at + S_PUSH + k]
            s[at + S_MOMENTUM + k] = p
            s[at + S_GRADIENT + k] = g
            error += inverse * g * g
            free = s[at + S_MASS] * s[at + S_FREE + k]
            scale += inverse * (free * free + s[at + S_PUSH + k] * s[at + S_PUSH + k])
        x, y, z = symmetric_times(
            s, at + S_INERTIA, s[at + S_VELOCITY + 3] - s[at + S_FREE + 3], s[at + S_VELOCITY + 4] - s[at + S_FREE + 4],
            s[at + S_VELOCITY + 5] - s[at + S_FREE + 5],
        )  # fmt: skip
        s[at + S_MOMENTUM + 3] = x
        s[at + S_MOMENTUM + 4] = y
        s[at + S_MOMENTUM + 5] = z
        for k in range(3, 6):
            s[at + S_GRADIENT + k] = s[at + S_MOMENTUM + k] - s[at + S_PUSH + k]
        error += _angular_square(s, at, S_GRADIENT)
        fx, fy, fz = s[at + S_FREE + 3], s[at + S_FREE + 4], s[at + S_FREE + 5]
        x, y, z = symmetric_times(s, at + S_INERTIA, fx, fy, fz)
        turning = s[at + S_TURNS] * (x * fx + y * fy + z * fz)
        scale += turning + _angular_square(s, at, S_PUSH)
    return sqrt(error), sqrt(scale)


@inner
def _evaluate_brake(s, c, a, b):
    """Impulse of a contact's spinning and rolling at the velocity, on the solids."""
    w0, w1, w2 = relative_spin(s, c, a, b, S_VELOCITY)
    n, t, u = brake_at(s, c, w0, w1, w2)
    for k in range(3):
        s[c + C_BRAKE_SPEED + k] = w0 if k == 0 else (w1 if k == 1 else w2)
        s[c + C_BRAKE + k] = n if k == 0 else (t if k == 1 else u)
    add_torque(s, c, a, b, S_PUSH, n, t, u)


@inner
def _evaluate_joint(tape, s, rigid, j):
    """Impulses of a joint's rows at the velocity, on the solids."""
    joint = joint_at(tape, rigid, j)
    a, b = joint_solids(tape, rigid, joint)
    row = row_at(tape, rigid, tape[joint + 4])
    for _ in range(tape[joint + 5]):
        if s[row + J_KIND] != OFF:
            u = row_velocity(s, row, a, b, S_VELOCITY)
            value, _ = row_impulse(s, row, u)
            s[row + J_SPEED] = u
            s[row + J_IMPULSE] = value
            add_row_impulse(s, row, a, b, S_PUSH, value)
        row += ROW_ENTRIES


@inner
def _angular_square(s, at, field):
    """g . I^-1 g of the angular half of a six-vector."""
    x = s[at + field + 3]
    y = s[at + field + 4]
    z = s[at + field + 5]
    a, b, c = symmetric_times(s, at + S_INVERSE_INERTIA, x, y, z)
    return a * x + b * y + c * z


@inner
def _add_columns(h, row, t0, t1, t2, x, y, z, moves, sign):
    """Add sign T A^T to a block, with columns t of T, A = (moves 1; [r] x) and r = (x, y, z)."""
    linear = splat(sign * moves)
    store(h, row, fma(linear, t0, load(h, row)))
    store(h, row + 1, fma(linear, t1, load(h, row + 1)))
    store(h, row + 2, fma(linear, t2, load(h, row + 2)))
    x = splat(sign * x)
    y = splat(sign * y)
    z = splat(sign * z)
    store(h, row + 3, fma(y, t2, fma(-z, t1, load(h, row + 3))))
    store(h, row + 4, fma(z, t0, fma(-x, t2, load(h, row + 4))))
    store(h, row + 5, fma(x, t1, fma(-y, t0, load(h, row + 5))))


@inner
def _columns(s, h, c, solid, arm, row):
    """Columns of T = A G in three rows of h; G is the matrix of nine rows' entries behind them."""
    x = s[c + arm]
    y = s[c + arm + 1]
    z = s[c + arm + 2]
    moves = s[solid + S_MOVES]
    for k in range(3):
        gx = h[row + 3, k]
        gy = h[row + 4, k]
        gz = h[row + 5, k]
        h[row + k, 0] = moves * gx
        h[row + k, 1] = moves * gy
        h[row + k, 2] = moves * gz
        h[row + k, 3] = y * gz - z * gy
        h[row + k, 4] = z * gx - x * gz
        h[row + k, 5] = x * gy - y * gx
        h[row + k, 6] = 0.0
        h[row + k, 7] = 0.0


@inner
def _stiffness(s, h, c, row):
    """G = D P D^T/R in the world's axes, into three rows of h; D are normal and tangents, P the derivative."""
    stiffness = 1.0 / s[c + C_COMPLIANCE]
    at = c + C_DERIVATIVE
    nn = s[at] * stiffness
    n1 = s[at + 1] * stiffness
    n2 = s[at + 2] * stiffness
    d11 = s[at + 3] * stiffness
    d12 = s[at + 4] * stiffness
    d22 = s[at + 5] * stiffness
    for k in range(3):
        a = s[c + C_NORMAL + k]
        t = s[c + C_TANGENT + k]
        b = s[c + C_BINORMAL + k]
        u = a * nn + t * n1 + b * n2
        v = a * n1 + t * d11 + b * d12
        w = a * n2 + t * d12 + b * d22
        for i in range(3):
            h[row + k, i] = (
                u * s[c + C_NORMAL + i] + v * s[c + C_TANGENT + i] + w * s[c + C_BINORMAL + i]
            )


@inner
def _put_masses(tape, s, h, n, rigid, size, matrix, rows):
    """A matrix with masses and inertias alone."""
    clear_rows(h, matrix, matrix + rows)
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        row = matrix + n[tape[rigid + STARTS] + i] + SIX * (i - n[tape[rigid + FIRST] + i])
        for k in range(3):
            h[row + k, k] = s[at + S_MASS]
        entry = at + S_INERTIA
        for k in range(3):
            for j in range(k + 1):
                h[row + 3 + k, 3 + j] = s[entry]
                h[row + 3 + j, 3 + k] = s[entry]
                entry += 1


@inner
def assemble_held(tape, s, n, rigid, size, joints, rows):
    """What all of an island's passes have in their matrices: masses, inertias, and the coordinates that joints lock."""
    if joints > 0:
        h = offset(s, 0)
        held = tape[rigid + HELD_ROW]
        work = tape[rigid + VECTOR_ROW] + size + 1
        _put_masses(tape, s, h, n, rigid, size, held, rows)
        for j in range(joints):
            _assemble_joint(tape, s, h, n, rigid, n[tape[rigid + HELD] + j], held, work, True)


@inner
def _assemble(tape, s, h, n, rigid, size, contacts, joints, rows):
    """Newton's matrix in the rows of the factor."""
    matrix = tape[rigid + MATRIX_ROW]
    work = tape[rigid + VECTOR_ROW] + size + 1
    if joints > 0:
        held = tape[rigid + HELD_ROW]
        for row in range(rows):
            store(h, matrix + row, load(h, held + row))
    else:
        _put_masses(tape, s, h, n, rigid, size, matrix, rows)
    for j in range(contacts):
        contact = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, contact)
        if s[c + C_DERIVATIVE] + s[c + C_DERIVATIVE + 3] + s[c + C_DERIVATIVE + 5] != 0.0:
            a = n[tape[rigid + END_A] + contact]
            b = n[tape[rigid + END_B] + contact]
            _stiffness(s, h, c, work + 3)
            own = solid_at(tape, rigid, a)
            _columns(s, h, c, own, C_ARM_A, work)
            i = n[tape[rigid + LOCAL] + a]
            t0 = load(h, work)
            t1 = load(h, work + 1)
            t2 = load(h, work + 2)
            row = matrix + n[tape[rigid + STARTS] + i]
            f = n[tape[rigid + FIRST] + i]
            x = s[c + C_ARM_A]
            y = s[c + C_ARM_A + 1]
            z = s[c + C_ARM_A + 2]
            moves = s[own + S_MOVES]
            _add_columns(h, row + SIX * (i - f), t0, t1, t2, x, y, z, moves, 1.0)
            if b >= 0:
                other = solid_at(tape, rigid, b)
                k = n[tape[rigid + LOCAL] + b]
                bx = s[c + C_ARM_B]
                by = s[c + C_ARM_B + 1]
                bz = s[c + C_ARM_B + 2]
                both = s[other + S_MOVES]
                if k < i:
                    _add_columns(h, row + SIX * (k - f), t0, t1, t2, bx, by, bz, both, -1.0)
                _columns(s, h, c, other, C_ARM_B, work)
                t0 = load(h, work)
                t1 = load(h, work + 1)
                t2 = load(h, work + 2)
                row = matrix + n[tape[rigid + STARTS] + k]
                f = n[tape[rigid + FIRST] + k]
                _add_columns(h, row + SIX * (k - f), t0, t1, t2, bx, by, bz, both, 1.0)
                if k > i:
                    _add_columns(h, row + SIX * (i - f), t0, t1, t2, x, y, z, moves, -1.0)
        if has_brake(s, c):
            _assemble_brake(tape, s, h, n, rigid, contact, matrix, work)
    for j in range(joints):
        _assemble_joint(tape, s, h, n, rigid, n[tape[rigid + HELD] + j], matrix, work, False)


@inner
def _assemble_brake(tape, s, h, n, rigid, contact, matrix, work):
    """Add how a contact's spinning and rolling give to the angular parts of its solids' blocks."""
    c = contact_at(tape, rigid, contact)
    w = c + C_BRAKE_SPEED
    nn, d11, d12, d22 = brake_derivative(s, c, s[w], s[w + 1], s[w + 2])
    a = n[tape[rigid + END_A] + contact]
    b = n[tape[rigid + END_B] + contact]
    for k in range(3):
        t = s[c + C_TANGENT + k]
        u = s[c + C_BINORMAL + k]
        x = nn * s[c + C_NORMAL + k]
        y = d11 * t + d12 * u
        z = d12 * t + d22 * u
        for j in range(3):
            h[work + k, j] = (
                x * s[c + C_NORMAL + j] + y * s[c + C_TANGENT + j] + z * s[c + C_BINORMAL + j]
            )
    i = n[tape[rigid + LOCAL] + a]
    turns = s[solid_at(tape, rigid, a) + S_TURNS]
    _add_turning(tape, h, n, rigid, matrix, work, i, i, turns)
    if b >= 0:
        k = n[tape[rigid + LOCAL] + b]
        both = s[solid_at(tape, rigid, b) + S_TURNS]
        _add_turning(tape, h, n, rigid, matrix, work, k, k, both)
        _add_turning(tape, h, n, rigid, matrix, work, max(i, k), min(i, k), -turns * both)


@inner
def _add_turning(tape, h, n, rigid, matrix, work, i, k, share):
    """Add a share of a symmetric matrix in three rows of h to the angular part of block (i, k)."""
    row = matrix + n[tape[rigid + STARTS] + i] + SIX * (k - n[tape[rigid + FIRST] + i])
    for x in range(3):
        for y in range(3):
            h[row + 3 + x, 3 + y] += share * h[work + x, y]


@inner
def _assemble_joint(tape, s, h, n, rigid, j, matrix, work, locked):
    """Add the products of those rows of a joint that are always held (``locked``), or of the others that are."""
    joint = joint_at(tape, rigid, j)
    a, b = joint_solids(tape, rigid, joint)
    i = n[tape[rigid + LOCAL] + tape[joint + 1]] if is_free(s, a) else -1
    k = n[tape[rigid + LOCAL] + tape[joint + 2]] if is_free(s, b) else -1
    row = row_at(tape, rigid, tape[joint + 4])
    for _ in range(tape[joint + 5]):
        kind = s[row + J_KIND]
        if kind != OFF and (kind == EQUAL) == locked:
            gives = locked
            if not locked:
                _, gives = row_impulse(s, row, s[row + J_SPEED])
            if gives:
                stiffness = 1.0 / s[row + J_COMPLIANCE]
                # Of what turns but does not move the force does nothing.
                x = load_at(s, row)
                y = load_at(s, row + W_B)
                if i >= 0 and s[a + S_MOVES] == 0.0:
                    x = _without_force(s, h, work, row)
                if k >= 0 and s[b + S_MOVES] == 0.0:
                    y = _without_force(s, h, work, row + W_B)
                store(h, work, x)
                store(h, work + 1, y)
                x = splat(stiffness) * x
                y = splat(stiffness) * y
                if i >= 0:
                    _add_product(h, n, rigid, tape, matrix, i, i, x, work)
                if k >= 0:
                    _add_product(h, n, rigid, tape, matrix, k, k, y, work + 1)
                if i > k and k >= 0:
                    _add_product(h, n, rigid, tape, matrix, i, k, x, work + 1)
                if k > i and i >= 0:
                    _add_product(h, n, rigid, tape, matrix, k, i, y, work)
        row += ROW_ENTRIES


@inner
def _without_force(s, h, work, wide):
    """A wide row's direction with its torques alone."""
    for c in range(8):
        h[work, c] = s[wide + c] if c > 2 else 0.0
    return load(h, work)


@inner
def _add_product(h, n, rigid, tape, matrix, i, k, x, other):
    """Add x y^T to block (i, k), with y in a row of h."""
    row = matrix + n[tape[rigid + STARTS] + i] + SIX * (k - n[tape[rigid + FIRST] + i])
    for c in range(SIX):
        store(h, row + c, fma(splat(h[other, c]), x, load(h, row + c)))


@inner
def _slope(tape, s, n, rigid, contacts, joints, start, rise, step):
    """Derivative of the function along the step."""
    slope = start + step * rise
    for j in range(contacts):
        c = contact_at(tape, rigid, n[tape[rigid + LIST] + j])
        d0 = s[c + C_CHANGE]
        d1 = s[c + C_CHANGE + 1]
        d2 = s[c + C_CHANGE + 2]
        l0, l1, l2, _, _, _, _ = impulse_at(
            s,
            c,
            s[c + C_SPEED] + step * d0,
            s[c + C_SPEED + 1] + step * d1,
            s[c + C_SPEED + 2] + step * d2,
        )
        slope -= l0 * d0 + l1 * d1 + l2 * d2
        if has_brake(s, c):
            w = c + C_BRAKE_SPEED
            d = c + C_BRAKE_CHANGE
            l0, l1, l2 = brake_at(
                s, c, s[w] + step * s[d], s[w + 1] + step * s[d + 1], s[w + 2] + step * s[d + 2]
            )
            slope -= l0 * s[d] + l1 * s[d + 1] + l2 * s[d + 2]
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            if s[row + J_KIND] != OFF:
                value, _ = row_impulse(s, row, s[row + J_SPEED] + step * s[row + J_CHANGE])
                slope -= value * s[row + J_CHANGE]
            row += ROW_ENTRIES
    return slope


@inner
def _line_search(tape, s, n, rigid, size, contacts, joints):
    """Length of the step at which the slope vanishes, by regula falsi (Illinois) on a bracket."""
    start = 0.0
    rise = 0.0
    descent = 0.0
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        x, y, z = symmetric_times(
            s, at + S_INERTIA, s[at + S_STEP + 3], s[at + S_STEP + 4], s[at + S_STEP + 5]
        )
        for k in range(3):
            d = s[at + S_STEP + k]
            start += d * s[at + S_MOMENTUM + k]
            rise += s[at + S_MASS] * d * d
            descent += d * s[at + S_GRADIENT + k]
        for k in range(3, 6):
            start += s[at + S_STEP + k] * s[at + S_MOMENTUM + k]
            descent += s[at + S_STEP + k] * s[at + S_GRADIENT + k]
        rise += x * s[at + S_STEP + 3] + y * s[at + S_STEP + 4] + z * s[at + S_STEP + 5]
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = contact_at(tape, rigid, i)
        a, b = contact_ends(tape, n, rigid, i)
        d0, d1, d2 = relative_velocity(s, c, a, b, S_STEP)
        s[c + C_CHANGE] = d0
        s[c + C_CHANGE + 1] = d1
        s[c + C_CHANGE + 2] = d2
        if has_brake(s, c):
            d0, d1, d2 = relative_spin(s, c, a, b, S_STEP)
            s[c + C_BRAKE_CHANGE] = d0
            s[c + C_BRAKE_CHANGE + 1] = d1
            s[c + C_BRAKE_CHANGE + 2] = d2
    for j in range(joints):
        joint = joint_at(tape, rigid, n[tape[rigid + HELD] + j])
        a, b = joint_solids(tape, rigid, joint)
        row = row_at(tape, rigid, tape[joint + 4])
        for _ in range(tape[joint + 5]):
            s[row + J_CHANGE] = row_velocity(s, row, a, b, S_STEP)
            row += ROW_ENTRIES
    high = 1.0
    at_high = _slope(tape, s, n, rigid, contacts, joints, start, rise, high)
    if at_high <= -_FLAT * descent:
        return high
    low = 0.0
    at_low = descent
    side = 0
    step = high
    for _ in range(_HALVINGS):
        step = (low * at_high - high * at_low) / (at_high - at_low)
        slope = _slope(tape, s, n, rigid, contacts, joints, start, rise, step)
        if abs(slope) <= -_FLAT * descent:
            break
        if slope > 0.0:
            high = step
            at_high = slope
            if side == 1:
                at_low *= 0.5
            side = 1
        else:
            low = step
            at_low = slope
            if side == -1:
                at_high *= 0.5
            side = -1
    return step


@inner
def _newton_step(tape, s, n, rigid, size, contacts, joints, rows):
    """Newton's step into the solids; whether the matrix could be factorised."""
    h = offset(s, 0)
    matrix = offset(s, LANES * tape[rigid + MATRIX_ROW])
    _assemble(tape, s, h, n, rigid, size, contacts, joints, rows)
    good = factorise(matrix, n, tape[rigid + FIRST], tape[rigid + STARTS], size)
    x = tape[rigid + VECTOR_ROW]
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            h[x + i, k] = -s[at + S_GRADIENT + k]
        h[x + i, 6] = 0.0
        h[x + i, 7] = 0.0
    solve_factored(
        matrix, n, tape[rigid + FIRST], tape[rigid + STARTS], size, x - tape[rigid + MATRIX_ROW]
    )
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_STEP + k] = h[x + i, k]
    return good


@inner
def minimise(tape, s, n, rigid, size, contacts, joints, rows, tolerance, iterations):
    """Newton's method for one pass; how many steps it took to settle, or -1."""
    last = 0.0
    for iteration in range(iterations):
        error, scale = _evaluate(tape, s, n, rigid, size, contacts, joints)
        # One step takes far more off than is asked for: without any, that must be there already, or it stays for good.
        if error <= (tolerance if iteration > 0 else _UNTOUCHED * tolerance) * scale:
            return iteration
        if not error < 1e300:
            return -1
        if iteration > 2 and error >= 0.5 * last and error <= _ROUNDING * scale:
            return iteration
        last = error
        if not _newton_step(tape, s, n, rigid, size, contacts, joints, rows):
            return -1
        step = _line_search(tape, s, n, rigid, size, contacts, joints)
        for i in range(size):
            at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
            for k in range(SIX):
                s[at + S_VELOCITY + k] += step * s[at + S_STEP + k]
    return -1
