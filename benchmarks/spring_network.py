"""Motion of networks of springs to high accuracy, by a program that shares nothing with the engine but the scene."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq
from scipy.sparse import csr_matrix

import steelyard as sy

Array = npt.NDArray[np.float64]
#: Longest step [s]: what turns and turns back within one is not seen.
_LONGEST = 1e-3


class SpringNetwork:
    """Particles under ``Spring`` and ``Bungee``, weight and damping.

    Args:
        scene: what is read, nothing else in it.
    """

    def __init__(self, scene: sy.Scene) -> None:
        particles = scene.particles
        place = {id(p): k for k, p in enumerate(particles)}
        springs = [thing for thing in scene.things if isinstance(thing, sy.Spring)]
        ends = np.array([(place[id(s.a)], place[id(s.b)]) for s in springs])
        rows = np.arange(len(springs))
        values = np.concatenate([np.ones(len(springs)), -np.ones(len(springs))])
        self.incidence = csr_matrix(
            (values, (np.concatenate([rows, rows]), ends.T.ravel())),
            shape=(len(springs), len(particles)),
        )
        self.inverse = np.array([[p.inverse_mass] for p in particles])
        self.rate = np.array([[-np.log(p.damping)] for p in particles])
        self.stiffness = np.array([[s.stiffness] for s in springs])
        self.rest = np.array([[s.rest_length] for s in springs])
        self.one_sided = np.array([[isinstance(s, sy.Bungee)] for s in springs])
        self._transposed = self.incidence.T.tocsr()
        self.gravity = np.asarray(scene.gravity, dtype=np.float64)
        self._weight = np.where(self.inverse > 0.0, self.gravity, 0.0)
        self.start = np.array([[p.position for p in particles], [p.velocity for p in particles]])

    def energy(self, position: Array, velocity: Array) -> Array:
        """Energy [J] at each of the times, from (times, particles, 3) positions and velocities."""
        movable = self.inverse > 0.0
        mass = np.where(movable, 1.0 / np.where(movable, self.inverse, 1.0), 0.0)[:, 0]
        found = []
        for x, v in zip(position, velocity, strict=True):
            moving = mass @ (0.5 * (v**2).sum(axis=1) - x @ self.gravity)
            stretch = self._stretch(np.array([x, v]))
            stretch = np.where(self.one_sided, np.maximum(stretch, 0.0), stretch)
            found.append(moving + 0.5 * float((self.stiffness * stretch**2).sum()))
        return np.array(found)

    def motion(self, times: Array, *, tolerance: float = 1e-11) -> tuple[Array, Array]:
        """Positions [m] and velocities [m/s], each (times, particles, 3), by DOP853.

        Every part is smooth: it ends where a bungee goes slack or taut, and until then the taut ones push as well.

        Args:
            times: where to give the state [s], rising.
            tolerance: relative, and absolute in metres and metres per second.
        """
        settings = {"rtol": tolerance, "atol": tolerance, "max_step": _LONGEST}
        time, state = 0.0, self.start.ravel()
        pulls = ~self.one_sided | (self._stretch(state) > 0.0)
        found = []
        for end in times:
            while time < end:
                rates = partial(self._rates, pulls)
                solver = DOP853(rates, time, state, float(end), **settings)
                turned = False
                while solver.status == "running" and not turned:
                    before, state = solver.t, solver.y
                    solver.step()
                    wrong = self.one_sided & (pulls != (self._stretch(solver.y) > 0.0))
                    turned = bool(wrong.any())
                if not turned:
                    time, state = solver.t, solver.y
                    continue
                path = solver.dense_output()
                when = {k: self._crossing(path, k, before, solver.t) for k in np.flatnonzero(wrong)}
                first = min(when, key=lambda k: when[k])
                if when[first] > before:
                    # The way there again: between its ends the step is less exact.
                    way = solve_ivp(
                        rates, (before, when[first]), state, method="DOP853", **settings
                    )
                    state = way.y[:, -1]
                time = when[first]
                pulls = pulls.copy()
                pulls[first] ^= True
            found.append(state)
        states = np.array(found).reshape(len(times), *self.start.shape)
        return states[:, 0], states[:, 1]

    def _stretch(self, state: Array) -> Array:
        """Length beyond the rest length (springs, 1), less than 0 where it is short."""
        apart = self.incidence @ state.reshape(self.start.shape)[0]
        return np.asarray(np.sqrt((apart**2).sum(axis=1, keepdims=True)) - self.rest)

    def _rates(self, pulls: Array, time: float, state: Array) -> Array:
        """Rates of positions and velocities while the given springs act."""
        x, v = state.reshape(self.start.shape)
        apart = self.incidence @ x
        length = np.sqrt((apart**2).sum(axis=1, keepdims=True))
        tension = np.where(pulls, self.stiffness * (length - self.rest), 0.0)
        force = self._transposed @ (-tension / length * apart)
        return np.concatenate([v, self._weight + self.inverse * force - self.rate * v]).ravel()

    def _crossing(
        self, path: Callable[[float], Array], k: int, before: float, after: float
    ) -> float:
        """When a bungee turns; at once where it is past that already, by rounding."""

        def stretch(time: float) -> float:
            return float(self._stretch(path(time))[k, 0])

        if (stretch(before) > 0.0) == (stretch(after) > 0.0):
            return before
        return float(brentq(stretch, before, after, xtol=1e-15))
