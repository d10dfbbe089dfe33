"""What a method of one's own is written with: an ``Integrator`` in one file, beside those of ``integrators``.

    class MyMethod(sy.extension.Integrator):
        def recipe(self, solver, acting): return ((my_step, 0),)
        def order(self): return 1
        def stable_limit(self): return 2.0

    @sy.extension.stage
    def my_step(tape, s, skip, part): ...

Stages are written in lane vectors (``math.lanes``), one number for each of eight worlds, on rows of the scratch that
the tape names (``model.tape``). The file of any method shows how.
"""

from .forces.accumulate import accumulate_forces
from .forces.springs import add_springs
from .integrators.base import Acting, Integrator, Recipe
from .integrators.motion import damp, drift, kick
from .kernel import inner
from .math.lanes import absolute, any_lane, fma, load, select, splat, sqrt, store
from .model import tape
from .solvers.base import Solver
from .stage import Stage, stage

__all__ = [
    "Acting",
    "Integrator",
    "Recipe",
    "Solver",
    "Stage",
    "absolute",
    "accumulate_forces",
    "add_springs",
    "any_lane",
    "damp",
    "drift",
    "fma",
    "inner",
    "kick",
    "load",
    "select",
    "splat",
    "sqrt",
    "stage",
    "store",
    "tape",
]
