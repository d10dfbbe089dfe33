"""Anchored damped spring by its exact flow: m x'' = -k (x - anchor) - c x' + F, F constant over the step.

With y = x - anchor - F/k the step is y' = p00 y + p01 v, v' = p10 y + p11 v; the four coefficients are the
exponential of the oscillator's matrix (``model.derived.oscillator``), in every regime of damping.

Record: x, v, acceleration, force, inverse mass, first row of p, first row of the anchor, m/k.
"""

from __future__ import annotations

from ..kernel import inner
from ..math.lanes import fma, load, store
from ..math.pointers import axes
from ..model.tape import H_CONSTRAINED, H_FORCED, H_FREE, H_POSITION, H_STIFF_SPRINGS

RECORD = 8


@inner
def flow_stiff_springs(tape, s):
    """Move every sprung particle by the exact solution over the step."""
    at = tape[H_STIFF_SPRINGS]
    for index in range(tape[at]):
        k = at + 1 + RECORD * index
        p = tape[k + 5]
        inverse = load(s, tape[k + 4])
        for component in range(axes(s)):
            pull = load(s, tape[k + 2] + component)
            if tape[H_FORCED] != 0:
                pull = fma(inverse, load(s, tape[k + 3] + component), pull)
            centre = fma(pull, load(s, tape[k + 7]), load(s, tape[k + 6] + component))
            y = load(s, tape[k] + component) - centre
            v = load(s, tape[k + 1] + component)
            moved = fma(load(s, p), y, fma(load(s, p + 1), v, centre))
            store(s, tape[k] + component, moved)
            if tape[H_CONSTRAINED] != 0:
                store(s, tape[H_FREE] + tape[k] - tape[H_POSITION] + component, moved)
            store(s, tape[k + 1] + component, fma(load(s, p + 2), y, load(s, p + 3) * v))
