"""What methods and environments of one's own are written with.

A method is an ``Integrator`` in one file, beside those of ``integrators``.

    class MyMethod(sy.extension.Integrator):
        def recipe(self, solver, acting): return ((my_step, 0),)
        def order(self): return 1
        def stable_limit(self): return 2.0

    @sy.extension.stage
    def my_step(tape, s, skip, part): ...

Stages are written in lane vectors (``math.lanes``), one number for each of eight worlds, on rows of the scratch that
the tape names (``model.tape``). The file of any method shows how.

Kernels of an environment loop over worlds. Where that takes long beside the physics, they can take eight at a time
too, from whole arrays (``math.array_lanes``), as those of Platform do.
"""

from .forces.accumulate import accumulate_forces
from .forces.springs import add_springs
from .integrators.base import Acting, Integrator, Recipe
from .integrators.motion import damp, drift, kick
from .kernel import inner
from .math.array_lanes import load_column, load_row, store_columns, store_row
from .math.lanes import absolute, any_lane, fma, load, select, splat, sqrt, store
from .math.pointers import LANES
from .model import tape
from .solvers.base import Solver
from .stage import Stage, stage

__all__ = [
    "LANES",
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
    "load_column",
    "load_row",
    "select",
    "splat",
    "sqrt",
    "stage",
    "store",
    "store_columns",
    "store_row",
    "tape",
]
