"""Symmetric compositions of RATTLE steps: order 4 or 6 from a method of order 2.

    Phi_h = R_(g1 h) R_(g2 h) ... R_(gs h),   g symmetric, sum of g = 1, sum of g^3 = 0,

with R the step of ``integrators.rattle``, damping included. Some g are negative: part of the step runs backwards in
time, where damping's exact flow amplifies by what the rest takes away again, so damping alone stays exact.

| substeps | order | coefficients | h w of a spring below | phase error per radian |
|---|---|---|---|---|
| 3 | 4 | Yoshida (1990), triple jump | 1.573 | 6.6e-2 (h w)^4 |
| 5 | 4 | Suzuki (1990) | 2.721 | 9.3e-4 (h w)^4 |
| 9 | 6 | Kahan & Li (1997) | 2.532 | 4.1e-4 (h w)^6 |

A substep costs what a step of RATTLE costs. Symplectic and time-reversible without damping; momenta and links are
held as RATTLE holds them. The order stands while damping is slow beside the step and forces are smooth: across the
kink of a bungee or of a float it drops. What a solver leaves of the places is divided by the length of a substep: below
some 1e-10 m errors rise again as steps get shorter, and sweeps that do not settle cost the order. Refuses cables and
contacts, since an impact cannot run backwards, drag, stiff springs and user-written forces.

Source: Hairer, Lubich & Wanner, *Geometric Numerical Integration*, II.4, V.3.2 and VII.1.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ..constraints.controls import move_controls
from ..math.lanes import load, store
from ..model.tape import (
    BODY,
    FRESH,
    H_BLOCKS,
    H_BODIES,
    H_BODIES_DAMPED,
    H_DAMPED,
    H_DAMPING,
    H_DT,
    H_PARTICLES,
    H_SUBSTEPS,
    SUBSTEP,
)
from ..scene import checks
from ..solvers.base import Solver
from ..solvers.gather import scale_multipliers
from ..solvers.stages import begin_step
from ..stage import stage
from .base import Acting, Integrator, Recipe
from .rattle import rattle_halves


def _around(*first: float) -> tuple[float, ...]:
    """The symmetric coefficients of sum 1 that begin so."""
    return (*first, 1.0 - 2.0 * sum(first), *reversed(first))


_YOSHIDA = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
_SUZUKI = 1.0 / (4.0 - 4.0 ** (1.0 / 3.0))
#: Coefficients, order and largest h w, by the number of substeps.
_COMPOSITIONS = {
    3: (_around(_YOSHIDA), 4, 1.573),
    5: (_around(_SUZUKI, _SUZUKI), 4, 2.721),
    9: (
        _around(
            0.39216144400731413928, 0.33259913678935943860, -0.70624617255763935981, 0.082213596293550800231
        ),
        6,
        2.532,
    ),
}  # fmt: skip

# Parts of a step name the half that a stage is for; behind them, the substep whose length is set.
_HALVES = 2


@dataclass(frozen=True)
class ComposedRattle(Integrator):
    """RATTLE steps composed to order 4 or 6 (see the module).

    Args:
        substeps: 3 or 5 for order 4, 9 for order 6.

    Raises:
        ValueError: there is no composition of so many.
    """

    substeps: int = 5

    damping_share: ClassVar[float] = 0.5
    evaluations: ClassVar[tuple[float | None, ...]] = ()
    solver_stages: ClassVar[tuple[bool, ...]] = (True,)
    reverses: ClassVar[bool] = True
    moves_bodies: ClassVar[bool] = True
    turns_freely: ClassVar[bool] = True

    def __post_init__(self) -> None:
        checks.whole("ComposedRattle", "substeps", self.substeps, least=1, remedy="Use 5.")
        if self.substeps not in _COMPOSITIONS:
            raise ValueError(
                f"ComposedRattle: substeps is {self.substeps!r}; it must be 3, 5 or 9. Use 5 for order 4."
            )

    @property
    def fractions(self) -> tuple[float, ...]:
        """Length of each substep over that of the step."""
        return _COMPOSITIONS[self.substeps][0]

    def recipe(self, solver: Solver | None, acting: Acting) -> Recipe:
        """The recipe of RATTLE once for each substep; the step's own length is put back for the clock."""
        halves = rattle_halves(acting)
        first: Recipe = ((halves[0], 0),)
        second: Recipe = ((halves[1], 1),)
        if solver is not None:
            first = ((begin_step, 0), (move_controls, 0), *first, (solver.stage, 0))
            second = (*second, (solver.stage, 1))
        recipe: Recipe = ()
        for k in range(self.substeps):
            recipe = (*recipe, (begin_substep, _HALVES + k), *first, *second)
        return (*recipe, (end_substeps, 1))

    def order(self) -> int:
        """Fourth or sixth order."""
        return _COMPOSITIONS[self.substeps][1]

    def stable_limit(self) -> float:
        """Largest dt times angular frequency, by the number of substeps."""
        return _COMPOSITIONS[self.substeps][2]


@stage
def begin_substep(tape, s, skip, part):
    """Set the length of a substep and the share of velocity that damping keeps over half of it.

    The position stage starts from the impulses of the last one, which grow with the square of the length.
    """
    record = tape[H_SUBSTEPS] + 1 + SUBSTEP * (part - _HALVES)
    store(s, tape[H_DT], load(s, tape[record]))
    if tape[H_DAMPED] != 0:
        for p in range(tape[H_PARTICLES]):
            store(s, tape[H_DAMPING] + p, load(s, tape[record + 1] + p))
    if tape[H_BODIES_DAMPED] != 0:
        at = tape[H_BODIES]
        for index in range(tape[at]):
            row = tape[at + 1 + BODY * index + 9]
            for k in range(2):
                store(s, row + k, load(s, tape[record + 3] + 2 * index + k))
    scale_multipliers(tape, s, load(s, tape[record + 2]))
    if part > _HALVES:
        # The factor at hand is that of the substep before, where this one begins.
        skip[tape[H_BLOCKS] + FRESH] = 0


@stage
def end_substeps(tape, s, skip, half):
    """The clock goes by the whole step."""
    store(s, tape[H_DT], load(s, tape[tape[H_SUBSTEPS] + 1 + SUBSTEP * tape[tape[H_SUBSTEPS]]]))
