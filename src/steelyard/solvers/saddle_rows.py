"""Right sides of the saddle-point system, and multipliers from its solution, of positions, accelerations, velocities.

Multipliers are tension over length [N/m] of links, positive in pull, and force [N] of riders. Work rows of a link
behind its gradient: rate of g after an impact, whether it was off its length at the step's start, one unused, and the
multiplier at the step's start.
"""

from __future__ import annotations

from ..constraints.links import link_half_square, link_rate
from ..constraints.riders import DECK, HEAD, rider_offset, rider_slip
from ..kernel import inner
from ..math.lanes import absolute, fma, load, select, splat, store
from ..math.pointers import axes
from ..math.vectors import between, dot
from ..model.tape import (
    H_IMPULSE,
    H_LINKS,
    H_MOVERS,
    H_PARTICLES,
    H_RIDERS,
    H_SADDLE_LINKS,
    H_SADDLE_RIDERS,
    H_TOLERANCE,
    LINK,
    SADDLE_LINK,
)

# A link is at its length, or off it, within so much of g over the length squared.
_NEAR = 1e-9


@inner
def _near(tape, s, length):
    return (splat(_NEAR) + load(s, tape[H_TOLERANCE])) * length * length


@inner
def pull(tape, s, work):
    """Forces of links and riders into the impulse rows; sizes of what was summed into rows ``work``, one per particle.

    Without links or riders there are no such rows, and none are asked for.
    """
    zero = splat(0.0)
    if tape[H_IMPULSE] < 0:
        return
    for row in range(3 * tape[H_PARTICLES] + 3):
        store(s, tape[H_IMPULSE] + row, zero)
    for row in range(tape[H_PARTICLES] + 1):
        store(s, work + row, zero)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        fa = tape[link + 4]
        fb = tape[link + 5]
        multiplier = load(s, tape[link + 12])
        d = tape[link + 13]
        size = zero
        for axis in range(axes(s)):
            part = multiplier * load(s, d + axis)
            size = size + absolute(part)
            store(s, fa + axis, load(s, fa + axis) - part)
            store(s, fb + axis, load(s, fb + axis) + part)
        a = work + (fa - tape[H_IMPULSE]) // 3
        b = work + (fb - tape[H_IMPULSE]) // 3
        store(s, a, load(s, a) + size)
        store(s, b, load(s, b) + size)
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        count = tape[at + 6]
        for axis in range(axes(s)):
            force = load(s, tape[at + 3] + axis)
            for k in range(count + 1):
                f = tape[at + 2] if k == 0 else tape[at + HEAD + DECK * (k - 1) + 2]
                part = force if k == 0 else force * load(s, tape[at + 9] + k - 1)
                store(s, f + axis, load(s, f + axis) + part)
                a = work + (f - tape[H_IMPULSE]) // 3
                store(s, a, load(s, a) + absolute(part))
        at += HEAD + DECK * count


@inner
def keep_multipliers(tape, s):
    """Note the multipliers of the step's start; worlds in which a link is off its length."""
    zero = splat(0.0)
    one = splat(1.0)
    off = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        store(s, tape[link + 14] + 3, load(s, tape[link + 12]))
        length = load(s, tape[link + 8])
        error = link_half_square(s, link, tape, length)
        near = _near(tape, s, length)
        over = error > near
        short = error < -near
        if tape[link + 10] == 0:
            over = over | short
        store(s, tape[link + 14] + 1, select(over, one, zero))
        off = off | over
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            off = off | (absolute(rider_offset(s, tape, at, axis)) > splat(_NEAR))
        at += HEAD + DECK * tape[at + 6]
    return off


@inner
def position_rows(tape, s, active, single):
    """Right sides for positions, and the set of taut cables; worlds that miss the tolerance.

    A cable is taut if it pulls, or else if it is too long. ``single``: only the lowest may change.
    """
    zero = splat(0.0)
    one = splat(1.0)
    half = splat(0.5)
    bad = zero > zero
    changed = zero > zero
    tolerance = load(s, tape[H_TOLERANCE])
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        length = load(s, tape[link + 8])
        error = link_half_square(s, link, tape, length)
        allowed = tolerance * length * length
        mask = tape[link + 15]
        if tape[link + 10] == 0:
            store(s, mask, one)
        else:
            multiplier = load(s, tape[link + 12])
            before = load(s, mask) > half
            taut = (multiplier > zero) | ((multiplier >= zero) & (error > allowed))
            flips = select(taut, one, zero) - select(before, one, zero)
            flips = active & (absolute(flips) > half)
            if single:
                flips = flips & (select(changed, zero, one) > half)
            changed = changed | flips
            now = select(flips, one - load(s, mask), load(s, mask))
            store(s, mask, now)
            lets_go = flips & (now < half)
            store(s, tape[link + 12], select(lets_go, zero, multiplier))
            error = error * now
        store(s, tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index], -error)
        bad = bad | (absolute(error) > allowed)
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            error = rider_offset(s, tape, at, axis)
            store(s, tape[k] + axis, -error)
            bad = bad | (absolute(error) > tolerance)
        k += 4 + 3 * tape[at + 6]
        at += HEAD + DECK * tape[at + 6]
    return bad | changed


@inner
def add_position_multipliers(tape, s, scale, active):
    """Add the solution, times ``scale``, to the multipliers of the active worlds."""
    zero = splat(0.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        row = tape[link + 12]
        change = load(s, tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index]) * scale
        change = select(active, change * load(s, tape[link + 15]), zero)
        store(s, row, load(s, row) + change)
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            row = tape[at + 3] + axis
            change = select(active, load(s, tape[k] + axis) * scale, zero)
            store(s, row, load(s, row) - change)
        k += 4 + 3 * tape[at + 6]
        at += HEAD + DECK * tape[at + 6]


@inner
def taut_as_pulled(tape, s):
    """The first set of taut cables: those that pull."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        pulls = select(load(s, tape[link + 12]) > zero, one, zero)
        store(s, tape[link + 15], pulls if tape[link + 10] != 0 else one)


@inner
def taut_at_rest(tape, s, dt):
    """Taut cables where motion starts: those at full length that do not slacken."""
    zero = splat(0.0)
    one = splat(1.0)
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        taut = one
        if tape[link + 10] != 0:
            length = load(s, tape[link + 8])
            least = -_near(tape, s, length)
            rate = link_rate(s, link, tape) - length * load(s, tape[link + 9])
            stays = (link_half_square(s, link, tape, length) > least) & (dt * rate > least)
            taut = select(stays, one, zero)
        store(s, tape[link + 15], taut)


@inner
def leaving(tape, s, dt):
    """Worlds whose velocities taut links or riders cannot follow."""
    zero = splat(0.0)
    found = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        length = load(s, tape[link + 8])
        leaves = dt * (link_rate(s, link, tape) - length * load(s, tape[link + 9]))
        leaves = absolute(leaves) * load(s, tape[link + 15])
        found = found | (leaves > _near(tape, s, length))
    at = tape[H_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            found = found | (absolute(dt * rider_slip(s, tape, at, axis)) > splat(_NEAR))
        at += HEAD + DECK * tape[at + 6]
    return found


@inner
def acceleration_rows(tape, s):
    """Right sides for accelerations: what the motion along links and riders asks for at its present speed."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        x, y, z = between(s, tape[link + 2], tape[link + 3])
        square = dot(x, y, z, x, y, z)
        rate = load(s, tape[link + 9])
        wanted = fma(load(s, tape[link + 8]), load(s, tape[link + 16]), rate * rate) - square
        row = tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index]
        store(s, row, wanted * load(s, tape[link + 15]))
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    mover = tape[H_MOVERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            wanted = splat(0.0)
            for p in range(tape[at + 6]):
                deck = at + HEAD + DECK * p
                rate = load(s, tape[mover + 2] + p)
                gain = load(s, tape[mover + 3] + p)
                wanted = fma(rate + rate, load(s, tape[deck + 1] + axis), wanted)
                wanted = fma(gain, load(s, tape[deck] + axis), wanted)
            store(s, tape[k] + axis, wanted)
        k += 4 + 3 * tape[at + 6]
        at += HEAD + DECK * tape[at + 6]
        mover += 5


@inner
def take_multipliers(tape, s, worlds):
    """The solution for accelerations becomes the multipliers of some worlds; those in which a cable pushed.

    It lets go.
    """
    zero = splat(0.0)
    half = splat(0.5)
    again = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        value = load(s, tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index])
        mask = load(s, tape[link + 15])
        value = value * mask
        if tape[link + 10] != 0:
            lets_go = (mask > half) & (value < zero)
            store(s, tape[link + 15], select(lets_go, zero, mask))
            value = select(lets_go, zero, value)
            again = again | lets_go
        row = tape[link + 12]
        store(s, row, select(worlds, value, load(s, row)))
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            row = tape[at + 3] + axis
            value = -load(s, tape[k] + axis)
            store(s, row, select(worlds, value, load(s, row)))
        k += 4 + 3 * tape[at + 6]
        at += HEAD + DECK * tape[at + 6]
    return again & worlds


@inner
def snapped(tape, s):
    """Worlds in which a cable that was slack at the step's start pulls at its end."""
    zero = splat(0.0)
    found = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            before = load(s, tape[link + 14] + 3)
            found = found | ((before <= zero) & (load(s, tape[link + 12]) > zero))
    return found


@inner
def velocity_rows(tape, s):
    """Right sides for an impact: the rates of links and riders that the velocities still lack."""
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        lacks = load(s, tape[link + 14]) - link_rate(s, link, tape)
        row = tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index]
        store(s, row, lacks * load(s, tape[link + 15]))
    at = tape[H_RIDERS] + 1
    k = tape[H_SADDLE_RIDERS] + 1
    for _ in range(tape[tape[H_RIDERS]]):
        for axis in range(axes(s)):
            store(s, tape[k] + axis, -rider_slip(s, tape, at, axis))
        k += 4 + 3 * tape[at + 6]
        at += HEAD + DECK * tape[at + 6]


@inner
def let_pushing_go(tape, s):
    """Worlds in which the impulse of a cable pushes; it lets go, unless it has to be pulled back to its length."""
    zero = splat(0.0)
    half = splat(0.5)
    again = zero > zero
    at = tape[H_LINKS]
    for index in range(tape[at]):
        link = at + 1 + LINK * index
        if tape[link + 10] != 0:
            impulse = load(s, tape[tape[H_SADDLE_LINKS] + 1 + SADDLE_LINK * index])
            mask = load(s, tape[link + 15])
            held = load(s, tape[link + 14] + 1)
            lets_go = (mask > half) & (impulse < zero) & (held < half)
            store(s, tape[link + 15], select(lets_go, zero, mask))
            again = again | lets_go
    return again
