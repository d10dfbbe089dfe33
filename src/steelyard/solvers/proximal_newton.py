"""Proximal Newton: rigid contacts with Coulomb's cone, exact and without sweeps.

With velocities v of the solids and v* what they would be without contacts, the impulses l of a pass are the nearest
points of their cones to

    y_n = l0_n + (b - mu |u_t| - u_n)/R,    y_t = l0_t - u_t/R,    u = J v,

and v minimises |v - v*|_M^2/2 + R |l|^2/2, a convex function whose gradient M (v - v*) - J^T l Newton's method brings
to 0 with an exact line search. Its matrix M + J^T D J/R, D the derivative of the projection, has the size of the solids
and not of the contacts, and is positive definite however redundant these are. Between passes l0 becomes l, which takes
the compliance R out (the proximal point method), and |u_t| in the shift mu |u_t| becomes that at hand (de Saxce & Feng
1998), which makes friction Coulomb's own. Islands are solved apart; one at rest begins with the impulses that hold it,
and costs a test.

In the position stage b = -gap/dt keeps surfaces from passing within the step; in the velocity stage contacts that
closed get b = 0, or the speed at which they rebound. Where surfaces overlap by more than ``slop`` a last solve from
rest moves them apart; its velocities are forgotten.

Source: Castro, Permenter & Han (2022), *An Unconstrained Convex Formulation of Compliant Contact*; Carpentier,
Le Lidec & Montaut (2024), *From Compliant to Rigid Contact Simulation*; Acary, Cadoux, Lemarechal & Malick (2011).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt
from typing import ClassVar

from ..collision.contact_list import (
    find_contacts,
    match_contacts,
    place_colliders,
    prepare_contacts,
)
from ..constraints.contact_rows import (
    accelerate,
    add_impulse,
    length,
    relative_velocity,
    world_vector,
)
from ..constraints.solids import (
    gather_solids,
    scatter_velocities,
    solid_at,
    symmetric_times,
)
from ..kernel import inner
from ..math.lanes import fma, load, splat, store
from ..math.pointers import LANES, doubles_at, offset
from ..model.rigid_layout import (
    C_ARM_A,
    C_ARM_B,
    C_BEFORE,
    C_BINORMAL,
    C_CHANGE,
    C_COMPLIANCE,
    C_DERIVATIVE,
    C_FRICTION,
    C_GAP,
    C_ID,
    C_IMPULSE,
    C_LEAST,
    C_NORMAL,
    C_PLACE,
    C_REBOUND,
    C_RESTITUTION,
    C_SHIFT,
    C_SPEED,
    C_TANGENT,
    C_WEIGHT,
    CAPACITY,
    CONTACT_ENTRIES,
    CONTACT_WORK,
    END_A,
    END_B,
    FIRST,
    LIST,
    LOCAL,
    MATRIX_ROW,
    N_COMPLIANCE,
    N_IMPULSE,
    N_ITERATIONS,
    N_PASSES,
    N_SHIFT,
    N_SLOP,
    N_TOLERANCE,
    NUMBERS,
    ORDER,
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
    SOLID,
    SOLID_RECORDS,
    SOLIDS,
    START_ROW,
    STARTS,
    STORED,
    STORED_ROW,
    T_IMPULSE,
    T_PLACE,
    T_REBOUND,
    VECTOR_ROW,
)
from ..model.tape import COUNT, H_BLOCKS, H_DT, H_RIGID, H_UNSETTLED
from ..scene import checks
from ..stage import Stage, stage
from .base import Solver
from .block_cholesky import SIX, clear_rows, factorise, solve_factored
from .friction_cone import project, projection_derivative
from .islands import gather_island, join

# Compliance of the fallback, which is solved once, and of the push, over the mobility of a contact.
_SOFT, _PUSH = 1e-4, 1e-3
# Share of a penetration that one step takes away, and the fastest push [m/s].
_SHARE, _FASTEST = 0.2, 3.0
# Compliance, residual, passes and steps of what takes rounding out of the impulses in the end.
_POLISH, _POLISHED, _POLISHES, _POLISH_STEPS = 1e-3, 1e-12, 2, 3
# Solids of an island in which it is worth that.
_FEW = 2
_HALVINGS = 30
_FLAT = 1e-3
# Residual that rounding may leave where no step lessens it.
_ROUNDING = 1e-6
# A gap [m] at which a contact that carried nothing is closed all the same.
_CLOSED = 1e-10


@dataclass(frozen=True)
class ProximalNewton(Solver):
    """Rigid contacts by the proximal Newton method (see the module).

    Args:
        tolerance: largest residual of a pass over the momentum at hand, both by kinetic energy.
        passes: most proximal passes.
        iterations: most Newton iterations of a pass; a world that needs more falls back to softer contacts.
        slop: penetration [m] that is left alone.
        contacts: most contacts of a world; by the number of its pairs by default. What is beyond sets a flag in
            ``world.health``, and the deepest are kept.
    """

    tolerance: float = 1e-9
    passes: int = 6
    iterations: int = 60
    slop: float = 1e-4
    contacts: int | None = None
    staged: ClassVar[bool] = True
    rigid: ClassVar[bool] = True

    def __post_init__(self) -> None:
        checks.number(
            "ProximalNewton",
            "slop",
            self.slop,
            checks.Limit(above=0.0, remedy="Use 1e-4 for a tenth of a millimetre."),
        )
        if self.contacts is not None:
            checks.whole(
                "ProximalNewton", "contacts", self.contacts, least=1, remedy="Leave it out."
            )

    @property
    def settings(self) -> tuple[float, ...]:
        """Numbers in the order of the layout."""
        return (1e-5, self.tolerance, 1e-9, 1e-4, self.slop, self.passes, self.iterations)

    @property
    def start(self) -> Stage:
        """Notes velocities, from which rebounds follow."""
        return keep_start_velocities

    @property
    def stage(self) -> Stage:
        """Contacts of the position stage (half 0) or of the velocity stage (half 1)."""
        return proximal_newton_stage


@inner
def _contact(tape, rigid, i):
    """First entry of a contact's work."""
    return tape[rigid + CONTACT_WORK] + CONTACT_ENTRIES * i


@inner
def _ends(tape, n, rigid, i):
    """Work of the solids of a contact; -1 for scenery."""
    b = n[tape[rigid + END_B] + i]
    a = solid_at(tape, rigid, n[tape[rigid + END_A] + i])
    return a, solid_at(tape, rigid, b) if b >= 0 else -1


@inner
def _impulse_at(s, c, u0, u1, u2):
    """Impulse of a contact at a velocity."""
    stiffness = 1.0 / s[c + C_COMPLIANCE]
    yn = s[c + C_BEFORE] + (s[c + C_LEAST] - s[c + C_FRICTION] * s[c + C_SHIFT] - u0) * stiffness
    y1 = s[c + C_BEFORE + 1] - u1 * stiffness
    y2 = s[c + C_BEFORE + 2] - u2 * stiffness
    l0, l1, l2, case, size = project(yn, y1, y2, s[c + C_FRICTION])
    return l0, l1, l2, case, size, y1, y2


@inner
def _evaluate(tape, s, n, rigid, size, contacts):
    """Impulses, their derivatives and the gradient at the velocity; its norm and that of the momenta."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_PUSH + k] = 0.0
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = _contact(tape, rigid, i)
        a, b = _ends(tape, n, rigid, i)
        u0, u1, u2 = relative_velocity(s, c, a, b, S_VELOCITY)
        l0, l1, l2, case, reach, y1, y2 = _impulse_at(s, c, u0, u1, u2)
        s[c + C_SPEED] = u0
        s[c + C_SPEED + 1] = u1
        s[c + C_SPEED + 2] = u2
        s[c + C_IMPULSE] = l0
        s[c + C_IMPULSE + 1] = l1
        s[c + C_IMPULSE + 2] = l2
        d = projection_derivative(y1, y2, s[c + C_FRICTION], l0, case, reach)
        at = c + C_DERIVATIVE
        s[at], s[at + 1], s[at + 2], s[at + 3], s[at + 4], s[at + 5] = d
        add_impulse(s, c, a, b, S_PUSH, l0, l1, l2)
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
        scale += _angular_square(s, at, S_PUSH)
    return sqrt(error), sqrt(scale)


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
    zero = splat(0.0)
    store(h, row + 3, fma(y, t2, fma(zero - z, t1, load(h, row + 3))))
    store(h, row + 4, fma(z, t0, fma(zero - x, t2, load(h, row + 4))))
    store(h, row + 5, fma(x, t1, fma(zero - y, t0, load(h, row + 5))))


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
def _assemble(tape, s, h, n, rigid, size, contacts, rows):
    """Newton's matrix in the rows of the factor."""
    matrix = tape[rigid + MATRIX_ROW]
    work = tape[rigid + VECTOR_ROW] + size + 1
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
    for j in range(contacts):
        contact = n[tape[rigid + LIST] + j]
        c = _contact(tape, rigid, contact)
        if s[c + C_DERIVATIVE] != 0.0:
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


@inner
def _slope(tape, s, n, rigid, contacts, start, rise, step):
    """Derivative of the function along the step."""
    slope = start + step * rise
    for j in range(contacts):
        c = _contact(tape, rigid, n[tape[rigid + LIST] + j])
        d0 = s[c + C_CHANGE]
        d1 = s[c + C_CHANGE + 1]
        d2 = s[c + C_CHANGE + 2]
        l0, l1, l2, _, _, _, _ = _impulse_at(
            s,
            c,
            s[c + C_SPEED] + step * d0,
            s[c + C_SPEED + 1] + step * d1,
            s[c + C_SPEED + 2] + step * d2,
        )
        slope -= l0 * d0 + l1 * d1 + l2 * d2
    return slope


@inner
def _line_search(tape, s, n, rigid, size, contacts):
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
        c = _contact(tape, rigid, i)
        a, b = _ends(tape, n, rigid, i)
        d0, d1, d2 = relative_velocity(s, c, a, b, S_STEP)
        s[c + C_CHANGE] = d0
        s[c + C_CHANGE + 1] = d1
        s[c + C_CHANGE + 2] = d2
    high = 1.0
    at_high = _slope(tape, s, n, rigid, contacts, start, rise, high)
    if at_high <= -_FLAT * descent:
        return high
    low = 0.0
    at_low = descent
    side = 0
    step = high
    for _ in range(_HALVINGS):
        step = (low * at_high - high * at_low) / (at_high - at_low)
        slope = _slope(tape, s, n, rigid, contacts, start, rise, step)
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
def _newton_step(tape, s, n, rigid, size, contacts, rows):
    """Newton's step into the solids; whether the matrix could be factorised."""
    h = offset(s, 0)
    matrix = offset(s, LANES * tape[rigid + MATRIX_ROW])
    _assemble(tape, s, h, n, rigid, size, contacts, rows)
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
def _minimise(tape, s, n, rigid, size, contacts, rows, tolerance, iterations):
    """Newton's method for one pass; how many steps it took to settle, or -1."""
    last = 0.0
    for iteration in range(iterations):
        error, scale = _evaluate(tape, s, n, rigid, size, contacts)
        if error <= tolerance * scale:
            return iteration
        if not error < 1e300:
            return -1
        if iteration > 2 and error >= 0.5 * last and error <= _ROUNDING * scale:
            return iteration
        last = error
        if not _newton_step(tape, s, n, rigid, size, contacts, rows):
            return -1
        step = _line_search(tape, s, n, rigid, size, contacts)
        for i in range(size):
            at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
            for k in range(SIX):
                s[at + S_VELOCITY + k] += step * s[at + S_STEP + k]
    return -1


@inner
def _begin_velocity(tape, s, n, rigid, size, contacts, warm):
    """Velocities that the impulses of the last pass make, or without any."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_PUSH + k] = 0.0
            s[at + S_VELOCITY + k] = s[at + S_FREE + k]
    if warm:
        for j in range(contacts):
            i = n[tape[rigid + LIST] + j]
            c = _contact(tape, rigid, i)
            a, b = _ends(tape, n, rigid, i)
            add_impulse(
                s, c, a, b, S_PUSH, s[c + C_BEFORE], s[c + C_BEFORE + 1], s[c + C_BEFORE + 2]
            )
        for i in range(size):
            accelerate(s, solid_at(tape, rigid, n[tape[rigid + ORDER] + i]), S_PUSH, S_VELOCITY)


@inner
def _polish(tape, s, n, rigid, size, contacts, rows):
    """Take rounding out of the impulses.

    That of velocities counts in them by one over the compliance: less with a larger one, which passes take out again.
    """
    for j in range(contacts):
        c = _contact(tape, rigid, n[tape[rigid + LIST] + j])
        s[c + C_COMPLIANCE] = _POLISH * s[c + C_WEIGHT]
    for _ in range(_POLISHES):
        taken = _minimise(tape, s, n, rigid, size, contacts, rows, _POLISHED, _POLISH_STEPS)
        for j in range(contacts):
            c = _contact(tape, rigid, n[tape[rigid + LIST] + j])
            for k in range(3):
                if taken < 0:
                    s[c + C_IMPULSE + k] = s[c + C_BEFORE + k]
                else:
                    s[c + C_BEFORE + k] = s[c + C_IMPULSE + k]
        if taken <= 0:
            break


@inner
def _solve_island(tape, s, n, rigid, size, contacts, rows):
    """All passes of an island; whether they settled."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    tolerance = numbers[N_TOLERANCE]
    iterations = int(numbers[N_ITERATIONS])
    _begin_velocity(tape, s, n, rigid, size, contacts, True)
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = _contact(tape, rigid, i)
        a, b = _ends(tape, n, rigid, i)
        s[c + C_COMPLIANCE] = numbers[N_COMPLIANCE] * s[c + C_WEIGHT]
        _, u1, u2 = relative_velocity(s, c, a, b, S_VELOCITY)
        s[c + C_SHIFT] = sqrt(u1 * u1 + u2 * u2)
    moved = False
    settled = False
    for _ in range(int(numbers[N_PASSES])):
        taken = _minimise(tape, s, n, rigid, size, contacts, rows, tolerance, iterations)
        if taken < 0:
            return False
        moved = moved or taken > 0
        change = 0.0
        shift = 0.0
        for j in range(contacts):
            c = _contact(tape, rigid, n[tape[rigid + LIST] + j])
            left = s[c + C_COMPLIANCE] * length(
                s[c + C_IMPULSE] - s[c + C_BEFORE],
                s[c + C_IMPULSE + 1] - s[c + C_BEFORE + 1],
                s[c + C_IMPULSE + 2] - s[c + C_BEFORE + 2],
            )
            change = max(change, left)
            u1 = s[c + C_SPEED + 1]
            u2 = s[c + C_SPEED + 2]
            slip = sqrt(u1 * u1 + u2 * u2)
            if s[c + C_IMPULSE] > 0.0:
                shift = max(shift, s[c + C_FRICTION] * abs(slip - s[c + C_SHIFT]))
            s[c + C_SHIFT] = slip
            for k in range(3):
                s[c + C_BEFORE + k] = s[c + C_IMPULSE + k]
        settled = change <= numbers[N_IMPULSE] and shift <= numbers[N_SHIFT]
        if settled:
            break
    if moved and settled and size <= _FEW:
        _polish(tape, s, n, rigid, size, contacts, rows)
    return True


@inner
def _solve_softly(tape, s, n, rigid, size, contacts, rows, compliance):
    """One pass with softer contacts from nothing; whether it settled."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    for j in range(contacts):
        c = _contact(tape, rigid, n[tape[rigid + LIST] + j])
        s[c + C_COMPLIANCE] = compliance * s[c + C_WEIGHT]
        s[c + C_SHIFT] = 0.0
        for k in range(3):
            s[c + C_BEFORE + k] = 0.0
    _begin_velocity(tape, s, n, rigid, size, contacts, False)
    taken = _minimise(
        tape,
        s,
        n,
        rigid,
        size,
        contacts,
        rows,
        10.0 * numbers[N_TOLERANCE],
        2 * int(numbers[N_ITERATIONS]),
    )
    return taken >= 0


@inner
def _solve(tape, s, n, rigid, count, k, push):
    """Solve all islands of lane k; solids end with the impulses on them in S_VELOCITY, or pushed with velocities."""
    join(tape, n, rigid, count)
    for seed in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, seed)
        local = n[tape[rigid + LOCAL] + seed]
        fixed = s[at + S_MOVES] == 0.0 and s[at + S_TURNS] == 0.0
        if fixed:
            for c in range(SIX):
                s[at + S_VELOCITY + c] = 0.0
        elif local < 0:
            size, contacts, rows = gather_island(tape, n, rigid, seed)
            good = True
            if push:
                good = _solve_softly(tape, s, n, rigid, size, contacts, rows, _PUSH)
            elif contacts > 0:
                good = _solve_island(tape, s, n, rigid, size, contacts, rows)
                if not good:
                    good = _solve_softly(tape, s, n, rigid, size, contacts, rows, _SOFT)
            if not good:
                s[LANES * tape[H_UNSETTLED] + k] = 1.0
            if not push:
                _keep_impulses(tape, s, n, rigid, size, contacts)


@inner
def _keep_impulses(tape, s, n, rigid, size, contacts):
    """S_VELOCITY = sum of the impulses on every solid of an island: equal and opposite to the bit."""
    for i in range(size):
        at = solid_at(tape, rigid, n[tape[rigid + ORDER] + i])
        for k in range(SIX):
            s[at + S_VELOCITY + k] = 0.0
    for j in range(contacts):
        i = n[tape[rigid + LIST] + j]
        c = _contact(tape, rigid, i)
        a, b = _ends(tape, n, rigid, i)
        add_impulse(
            s, c, a, b, S_VELOCITY, s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2]
        )


@inner
def _store_contacts(tape, s, n, rigid, k, count):
    """Ids, impulses, places and rebounds of the contacts at hand, for the next stage."""
    for j in range(tape[rigid + CAPACITY]):
        at = LANES * (tape[rigid + STORED_ROW] + STORED * j) + k
        if j < count:
            c = _contact(tape, rigid, j)
            s[at] = s[c + C_ID] + 1.0
            x, y, z = world_vector(
                s, c, s[c + C_IMPULSE], s[c + C_IMPULSE + 1], s[c + C_IMPULSE + 2]
            )
            s[at + LANES * T_IMPULSE] = x
            s[at + LANES * (T_IMPULSE + 1)] = y
            s[at + LANES * (T_IMPULSE + 2)] = z
            for i in range(3):
                s[at + LANES * (T_PLACE + i)] = s[c + C_PLACE + i]
            s[at + LANES * T_REBOUND] = s[c + C_REBOUND]
        else:
            if s[at] == 0.0:
                break
            for field in range(STORED):
                s[at + LANES * field] = 0.0


@inner
def _rebounds(tape, s, n, rigid, k, count, dt):
    """Speed at which contacts that closed within the step leave, from that at which they met.

    Under the normal acceleration a of free motion the surfaces meet at the square of their speed at the start minus
    2 a gap: so energy is what restitution says, whatever the step.
    """
    record = tape[rigid + SOLID_RECORDS]
    start = tape[rigid + START_ROW]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(3):
            s[at + S_GRADIENT + c] = s[LANES * (start + 6 * i + c) + k] * s[at + S_MOVES]
        a, b, c = symmetric_times(
            s, at + S_INVERSE_INERTIA, s[LANES * (start + 6 * i + 3) + k], s[LANES * (start + 6 * i + 4) + k],
            s[LANES * (start + 6 * i + 5) + k],
        )  # fmt: skip
        s[at + S_GRADIENT + 3] = a
        s[at + S_GRADIENT + 4] = b
        s[at + S_GRADIENT + 5] = c
        record += SOLID
    for i in range(count):
        c = _contact(tape, rigid, i)
        s[c + C_REBOUND] = 0.0
        if s[c + C_RESTITUTION] > 0.0:
            a, b = _ends(tape, n, rigid, i)
            before, _, _ = relative_velocity(s, c, a, b, S_GRADIENT)
            half, _, _ = relative_velocity(s, c, a, b, S_FREE)
            gap = s[c + C_GAP]
            if gap + dt * half < 0.0:
                square = before * before - 4.0 * (half - before) / dt * gap
                s[c + C_REBOUND] = s[c + C_RESTITUTION] * sqrt(max(square, 0.0))


@inner
def _position_stage(tape, s, n, rigid, k, dt):
    """Before the drift: no gap may close beyond touching."""
    gather_solids(tape, s, rigid, k)
    place_colliders(tape, s, rigid, k, dt)
    count = find_contacts(tape, s, n, rigid, k, 0.0)
    prepare_contacts(tape, s, n, rigid, count)
    match_contacts(tape, s, n, rigid, k, count)
    if tape[rigid + START_ROW] >= 0:
        _rebounds(tape, s, n, rigid, k, count, dt)
    for i in range(count):
        c = _contact(tape, rigid, i)
        s[c + C_LEAST] = -max(s[c + C_GAP], 0.0) / dt
    _solve(tape, s, n, rigid, count, k, False)
    scatter_velocities(tape, s, rigid, k)
    _store_contacts(tape, s, n, rigid, k, count)


@inner
def _velocity_stage(tape, s, n, rigid, k, dt):
    """After the last kick: surfaces that touch do not approach; then overlaps are pushed apart."""
    numbers = doubles_at(tape[rigid + NUMBERS])
    slop = numbers[N_SLOP]
    gather_solids(tape, s, rigid, k)
    place_colliders(tape, s, rigid, k, dt)
    count = find_contacts(tape, s, n, rigid, k, 0.0)
    prepare_contacts(tape, s, n, rigid, count)
    match_contacts(tape, s, n, rigid, k, count)
    deep = False
    for i in range(count):
        c = _contact(tape, rigid, i)
        closed = s[c + C_GAP] <= _CLOSED or s[c + C_BEFORE] > 0.0
        # What is open does not act: it would have to approach at more than light.
        s[c + C_LEAST] = s[c + C_REBOUND] if closed else -1e30
        deep = deep or s[c + C_GAP] < -slop
    _solve(tape, s, n, rigid, count, k, False)
    scatter_velocities(tape, s, rigid, k)
    _store_contacts(tape, s, n, rigid, k, count)
    if deep:
        _push_apart(tape, s, n, rigid, k, count, dt, slop)


@inner
def _push_apart(tape, s, n, rigid, k, count, dt, slop):
    """Move overlapping solids apart by a solve from rest, of which no velocity stays."""
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        for c in range(SIX):
            s[at + S_FREE + c] = 0.0
    for i in range(count):
        c = _contact(tape, rigid, i)
        gap = s[c + C_GAP]
        s[c + C_LEAST] = min(-_SHARE * gap / dt, _FASTEST) if gap < -slop else -max(gap, 0.0) / dt
    _solve(tape, s, n, rigid, count, k, True)
    record = tape[rigid + SOLID_RECORDS]
    for i in range(tape[rigid + SOLIDS]):
        at = solid_at(tape, rigid, i)
        flags = tape[record + 7]
        if flags & 1 != 0:
            for c in range(3):
                s[LANES * (tape[record] + c) + k] += dt * s[at + S_VELOCITY + c]
        if flags & 2 != 0:
            _turn(s, tape[record + 1], k, dt, at + S_VELOCITY + 3)
        record += SOLID


@inner
def _turn(s, q, k, dt, at):
    """Turn a quaternion in lane k by an angular velocity over dt."""
    w = s[LANES * q + k]
    x = s[LANES * (q + 1) + k]
    y = s[LANES * (q + 2) + k]
    z = s[LANES * (q + 3) + k]
    a = 0.5 * dt * s[at]
    b = 0.5 * dt * s[at + 1]
    c = 0.5 * dt * s[at + 2]
    nw = w - a * x - b * y - c * z
    nx = x + a * w + b * z - c * y
    ny = y + b * w + c * x - a * z
    nz = z + c * w + a * y - b * x
    inverse = 1.0 / sqrt(nw * nw + nx * nx + ny * ny + nz * nz)
    s[LANES * q + k] = nw * inverse
    s[LANES * (q + 1) + k] = nx * inverse
    s[LANES * (q + 2) + k] = ny * inverse
    s[LANES * (q + 3) + k] = nz * inverse


@stage
def keep_start_velocities(tape, s, skip, half):
    """Velocities and momenta before the first kick, from which rebounds follow."""
    rigid = tape[H_RIGID]
    start = tape[rigid + START_ROW]
    if start >= 0:
        record = tape[rigid + SOLID_RECORDS]
        for _ in range(tape[rigid + SOLIDS]):
            for c in range(3):
                store(s, start + c, load(s, tape[record + 2] + c))
                momentum = tape[record + 3]
                store(s, start + 3 + c, load(s, momentum + c) if momentum >= 0 else splat(0.0))
            start += 6
            record += SOLID


@stage
def proximal_newton_stage(tape, s, skip, half):
    """Position stage, before the drift, or velocity stage, after the last kick, of every lane that is a world."""
    rigid = tape[H_RIGID]
    dt = s[LANES * tape[H_DT]]
    for k in range(skip[tape[H_BLOCKS] + COUNT]):
        if half == 0:
            _position_stage(tape, s, skip, rigid, k, dt)
        else:
            _velocity_stage(tape, s, skip, rigid, k, dt)
