"""Newton's method on Coulomb's law, for the few contacts of one world.

Alart & Curnier (1991): with u = W l - b and per-contact scales r_n, r_t, the law is the fixed point

    l_n = max(0, l_n - r_n u_n),    l_t = projection of (l_t - r_t u_t) on the disc of radius mu l_n,

a piecewise smooth equation. Each contact is open, sticks or slides at the present guess; that choice gives
three rows of a dense system, solved by elimination. Contacts joined by links share their load in more ways
than one: a little softness, u + e (l - l0) for u, makes the answer unique, and solving again from l0 = l takes
it out (the proximal point method). Converges in a few iterations from the last step's impulses; where it
does not, sweeps follow.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import absolute, any_lane, fma, load, select, splat, sqrt, store
from ..math.vectors import dot, inverse, load_vector
from ..model.tape import CONTACT, H_CONTACT_PRODUCTS, H_CONTACTS, H_DENSE, H_GUESS, H_RIGHT
from .cone_rows import put_motion_rows, relative_motion

_ITERATIONS = 15
# Before so many of them the anchor moves along: what softness leaves need not be taken out afterwards.
_ANCHORED = 8
_SETTLED = 1e-11
# Share of the allowed motion that errors may make.
_SHARE = 1e-2
# Of a contact's work rows: behind its impulses at the start of a solve, and at its anchor.
_SCALES = 6


@inner
def anchor(tape, s, skip, worlds):
    """From here on softness pulls towards the impulses of the guess, in the worlds of the mask."""
    at = tape[H_CONTACTS]
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            for axis in range(3):
                row = tape[contact + 23] + 3 + axis
                value = load(s, tape[H_GUESS] + tape[contact + 19] + axis)
                store(s, row, select(worlds, value, load(s, row)))


@inner
def softened_motion(tape, s, skip, contact, k, softness):
    """W l - b + e (l - l0) of one contact at the guess: three lane vectors."""
    soft = splat(softness) * load(s, tape[k + 3])
    slot = tape[contact + 19]
    guess = tape[H_GUESS] + slot
    right = tape[H_RIGHT] + slot
    anchor = tape[contact + 23] + 3
    a, b, c = relative_motion(tape, s, skip, k, tape[H_GUESS])
    a = fma(soft, load(s, guess) - load(s, anchor), a - load(s, right))
    b = fma(soft, load(s, guess + 1) - load(s, anchor + 1), b - load(s, right + 1))
    c = fma(soft, load(s, guess + 2) - load(s, anchor + 2), c - load(s, right + 2))
    return a, b, c


@inner
def _scale(tape, s, skip, softness):
    """Of every contact the motion that its own unit impulse makes, and the inverses r_n and r_t, in its work rows.

    Along the surface half of that motion: with twice the inverse the fixed point itself would just contract.
    """
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_CONTACTS]
    k = tape[H_CONTACT_PRODUCTS] + 1
    for index in range(tape[at]):
        contact = at + 1 + CONTACT * index
        if skip[tape[contact + 20]] == 0:
            w = tape[k + 1]
            soft = splat(softness) * load(s, tape[k + 3])
            w00 = load(s, w) + soft
            w11 = load(s, w + 2) + soft
            w22 = load(s, w + 5) + soft
            size = splat(0.5) * (select(w11 > w22, w11, w22) + absolute(load(s, w + 4)))
            row = tape[contact + 23] + _SCALES
            store(s, row, w00)
            store(s, row + 1, size)
            store(s, row + 2, select(w00 > zero, one / w00, zero))
            store(s, row + 3, select(size > zero, one / size, zero))
        k += 5 + 4 * tape[k + 4]


@inner
def _contact_system(tape, s, skip, contact, k, velocity, first, width, softness, full):
    """Three rows of the system for one contact; its error, the size of its impulse, the motion that the error makes.

    A contact that is coupled to fewer than ``full`` others leaves gaps in its rows.
    """
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    slot = tape[contact + 19]
    guess = tape[H_GUESS] + slot
    row = tape[H_DENSE] + (slot - first) * width
    last = width - 1
    if tape[k + 4] < full:
        for entry in range(3 * width):
            store(s, row + entry, zero)
    un, ut, uu = softened_motion(tape, s, skip, contact, k, softness)
    n = load(s, guess)
    t = load(s, guess + 1)
    u = load(s, guess + 2)
    soft = splat(softness) * load(s, tape[k + 3])
    scales = tape[contact + 23] + _SCALES
    motion_n = load(s, scales)
    motion_t = load(s, scales + 1)
    rn = load(s, scales + 2)
    rt = load(s, scales + 3)
    possible = load(s, tape[contact + 18]) > half
    loads = n - rn * un > zero
    if velocity:
        loads = loads | (load(s, tape[contact + 18] + 3) > half)
    closed = select(possible & loads, one, zero)
    open_ = one - closed
    # Normal: u_n = 0 where closed, l_n = 0 where open.
    own = row + slot - first
    normal_error = select(closed > half, rn * un, n)
    store(s, row + last, -normal_error)
    # Tangents: where they slide, l_t = mu l_n e with e the direction of l_t - r_t u_t.
    pt = t - rt * ut
    pu = u - rt * uu
    length = sqrt(fma(pu, pu, pt * pt))
    friction = load(s, tape[contact + 14])
    bound = friction * select(n > zero, n, zero)
    slides = (length > bound) & (closed > half)
    shorter = one / select(length > zero, length, one)
    et = pt * shorter
    eu = pu * shorter
    share = select(slides, bound * shorter, closed)
    p00 = select(slides, one - et * et, one)
    p01 = select(slides, -et * eu, zero)
    p11 = select(slides, one - eu * eu, one)
    k00 = share * p00
    k01 = share * p01
    k11 = share * p11
    next_ = row + width
    other = next_ + width
    factors = closed * rn, rt * k00, rt * k01, rt * k11
    put_motion_rows(tape, s, skip, k, row, width, factors, first)
    store(s, own, load(s, own) + fma(closed * rn, soft, open_))
    own = next_ + slot - first
    store(s, own + 1, load(s, own + 1) + one - k00 + rt * k00 * soft)
    store(s, own + 2, load(s, own + 2) - k01 + rt * k01 * soft)
    store(s, own, load(s, own) - select(slides, friction * et, zero))
    own = other + slot - first
    store(s, own + 1, load(s, own + 1) - k01 + rt * k01 * soft)
    store(s, own + 2, load(s, own + 2) + one - k11 + rt * k11 * soft)
    store(s, own, load(s, own) - select(slides, friction * eu, zero))
    sticks = closed > half
    error_t = select(slides, t - bound * et, select(sticks, rt * ut, t))
    error_u = select(slides, u - bound * eu, select(sticks, rt * uu, u))
    store(s, next_ + last, -error_t)
    store(s, other + last, -error_u)
    tangential = absolute(error_t) + absolute(error_u)
    error = absolute(normal_error) + tangential
    moved = fma(motion_t, tangential, motion_n * absolute(normal_error))
    return error, absolute(n) + absolute(t) + absolute(u), moved


@inner
def _eliminate(s, dense, count):
    """Solve the dense system in place by blocks of three, last column the right side."""
    size = 3 * count
    width = size + 1
    for k in range(count):
        row = dense + 3 * k * width
        own = row + 3 * k
        ax, bx, cx = load_vector(s, own)
        ay, by, cy = load_vector(s, own + width)
        az, bz, cz = load_vector(s, own + 2 * width)
        px, py, pz, qx, qy, qz, rx, ry, rz = inverse(ax, ay, az, bx, by, bz, cx, cy, cz)
        for column in range(3 * k + 3, width):
            at = row + column
            x = load(s, at)
            y = load(s, at + width)
            z = load(s, at + 2 * width)
            u = dot(px, py, pz, x, y, z)
            v = dot(qx, qy, qz, x, y, z)
            w = dot(rx, ry, rz, x, y, z)
            store(s, at, u)
            store(s, at + width, v)
            store(s, at + 2 * width, w)
            u = -u
            v = -v
            w = -w
            for below in range(3 * k + 3, size):
                x, y, z = load_vector(s, dense + below * width + 3 * k)
                at = dense + below * width + column
                store(s, at, fma(z, w, fma(y, v, fma(x, u, load(s, at)))))
    for k in range(count - 1, 0, -1):
        u = -load(s, dense + 3 * k * width + size)
        v = -load(s, dense + (3 * k + 1) * width + size)
        w = -load(s, dense + (3 * k + 2) * width + size)
        for above in range(3 * k):
            x, y, z = load_vector(s, dense + above * width + 3 * k)
            at = dense + above * width + size
            store(s, at, fma(z, w, fma(y, v, fma(x, u, load(s, at)))))


@inner
def newton(tape, s, skip, velocity, worlds, allowed, softness):
    """Improve the guess rows of ``worlds``; the worlds that still miss the law afterwards.

    They meet it where errors move contacts by little beside ``allowed``, or are rounding beside the impulses.
    """
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_CONTACTS]
    count = tape[at]
    first = tape[at + 1 + 19]
    size = 3 * count
    width = size + 1
    # Rows are full where each contact is coupled to all others; a block left out makes gaps.
    full = count - 1
    for index in range(count):
        full += skip[tape[at + 1 + CONTACT * index + 20]]
    _scale(tape, s, skip, softness)
    moving = worlds
    for turn in range(_ITERATIONS + 1):
        if turn < _ANCHORED:
            anchor(tape, s, skip, moving)
        error = zero
        largest = splat(1e-300)
        most = zero
        k = tape[H_CONTACT_PRODUCTS] + 1
        for index in range(count):
            contact = at + 1 + CONTACT * index
            if skip[tape[contact + 20]] == 0:
                wrong, extent, moved = _contact_system(
                    tape, s, skip, contact, k, velocity, first, width, softness, full
                )
                error = error + wrong
                most = select(moved > most, moved, most)
                largest = select(extent > largest, extent, largest)
            else:
                row = tape[H_DENSE] + 3 * index * width
                for entry in range(3 * width):
                    store(s, row + entry, zero)
                for axis in range(3):
                    store(s, row + axis * width + 3 * index + axis, one)
            k += 5 + 4 * tape[k + 4]
        moving = moving & (error > splat(_SETTLED) * largest) & (most > splat(_SHARE) * allowed)
        if turn == _ITERATIONS or not any_lane(moving):
            break
        _eliminate(s, tape[H_DENSE], count)
        for index in range(count):
            contact = at + 1 + CONTACT * index
            if skip[tape[contact + 20]] == 0:
                for axis in range(3):
                    guess = tape[H_GUESS] + tape[contact + 19] + axis
                    change = load(s, tape[H_DENSE] + (3 * index + axis) * width + size)
                    store(s, guess, load(s, guess) + select(moving, change, zero))
    return moving
