"""The method that a scene needs: the cheapest that holds a tolerance, tried on the scene itself.

What a step costs comes from a table that the laboratory measured (``costs.json``, see ``candidates``). What a step errs
by is measured on the scene: a run is compared with a reference, which is the run of the method of highest order that
halving the step no longer changes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import count
from operator import mul
from typing import TYPE_CHECKING

import numpy as np

from .candidates import Candidate, candidates, contacts_at_a_time, cost_table, kinks_per_second
from .diagnostics.energy import kinetic_energy
from .diagnostics.landmarks import landmarks
from .methods import Method
from .scene import checks
from .scene.forces import AnchoredBungee, Bungee, Buoyancy
from .scene.links import Cable, CableConstraint
from .scene.scene import CONTACTS, Scene

if TYPE_CHECKING:
    from .world import World


@dataclass(frozen=True)
class _Margin:
    """Shares of the tolerance that are aimed at and accepted, and the shorter steps, by so much, that must hold too.

    Behind a kink or an impact errors jump with the step, and one step may hold by luck.
    """

    aim: float
    accept: float
    shorter: tuple[float, ...]


#: Least number of times at which runs are compared. Runs of few steps are compared at other times, up to twice as many,
#: so that any number of steps will do.
_LOOKS = 20
#: Most steps of a run; what needs more is out of reach.
_MOST = 400_000
#: Share of the tolerance that the reference may err by.
_REFERENCE = 0.04
_SMOOTH = _Margin(0.88, 0.96, (1.07, 1.19, 1.37))
_KINKED = _Margin(0.75, 0.9, (1.03, 1.07, 1.11, 1.15, 1.19, 1.24, 1.3, 1.37))
_KINKS = (Bungee, AnchoredBungee, Buoyancy, Cable, CableConstraint, *CONTACTS)
_TRIES = 12
#: Error from which on a run has blown up.
_LOST = 1e3
#: Most by which the number of steps grows from one try to the next.
_FARTHEST = 64.0
#: Height [m] whose energy is the least that errors of energy are held against: what rests has no other.
_LIFT = 1e-3


@dataclass(frozen=True)
class Considered:
    """What was found about one candidate.

    Attributes:
        name: of the method.
        dt: largest step found to hold the tolerance [s]; None where none was found.
        error: measured on the scene at that step, inf where none was found.
        cost: expected [us per simulated second and world], inf where no step was found.
        verdict: in words.
    """

    name: str
    dt: float | None
    error: float
    cost: float
    verdict: str


@dataclass(frozen=True)
class Choice:
    """The chosen method and why it won; ``print`` shows all that was considered.

    Attributes:
        method: the cheapest that holds the tolerance.
        tolerance: what was asked for.
        horizon: over which time [s].
        error: measured on the scene.
        cost: expected [us per simulated second and world].
        considered: all candidates that can step the scene, the cheapest first.
    """

    method: Method
    tolerance: float
    horizon: float
    error: float
    cost: float
    considered: tuple[Considered, ...] = field(repr=False)

    def __str__(self) -> str:
        lines = [
            f"{self.considered[0].name} at {1.0 / self.method.dt:.6g} Hz holds {self.tolerance:g} over "
            f"{self.horizon:g} s: error {self.error:.2g}, {self.cost:.3g} us per simulated second and world",
            f"  {'method':<28} {'rate [Hz]':>11} {'error':>9} {'cost [us]':>11}  verdict",
        ]
        for entry in self.considered:
            rate = f"{1.0 / entry.dt:.6g}" if entry.dt else "-"
            error = f"{entry.error:.2g}" if entry.dt else "-"
            cost = f"{entry.cost:.4g}" if entry.dt else "-"
            lines.append(f"  {entry.name:<28} {rate:>11} {error:>9} {cost:>11}  {entry.verdict}")
        return "\n".join(lines)


@dataclass(frozen=True)
class _Track:
    """One run, at the looks that count: landmarks (looks, n, 3), energies (looks,), worst residual of a link.

    ``scale`` is what errors of the energy are a share of: the most kinetic energy, the range of the energy, or what
    lifts all particles by a millimetre.
    """

    position: np.ndarray
    energy: np.ndarray
    residual: float
    scale: float

    def distance(self, other: _Track) -> float:
        """Largest error: of a place [m], of the energy as a share of what moves, of a link as a share of it."""
        energy = float(np.abs(self.energy - other.energy).max())
        place = float(np.linalg.norm(self.position - other.position, axis=2).max())
        share = energy / other.scale if other.scale > 0.0 else 0.0
        return max(place, share, self.residual)


class _Runs:
    """Runs of one candidate over the horizon."""

    def __init__(self, candidate: Candidate, scene: Scene, horizon: float, since: float) -> None:
        from .world import World

        self.candidate = candidate
        self.order = max(candidate.integrator.order(), 1)
        solver = candidate.solver
        self.exact = solver is None or solver.exact
        self._scene = scene
        self._horizon = horizon
        self._since = since
        #: Kinks that divide its steps, per second; contacts of bodies at a time.
        self.events = 0.0
        self.contacts = 0.0
        self._world: type[World] = World
        self._tracks: dict[tuple[int, int], _Track | None] = {}
        self._model = self._build(_LOOKS).model

    def dt(self, steps: int) -> float:
        """Step [s] of a run of so many."""
        return self._horizon / steps

    def cost(self, steps: int) -> float:
        """Expected cost [us per simulated second and world]."""
        dt = self.dt(steps)
        each = cost_table()[self.candidate.name]
        step = sum(map(mul, each, self.candidate.work(self._scene, self._model, dt, self.contacts)))
        return step * self.candidate.runs(self.events * dt) / dt

    def _build(self, steps: int) -> World:
        return self._world(self._scene, method=self.candidate.at(self.dt(steps)))

    def track(self, steps: int, looks: int) -> _Track | None:
        """The run, or None where it broke.

        Args:
            steps: how many, a multiple of the looks.
            looks: at how many times.
        """
        if (steps, looks) not in self._tracks:
            self._tracks[steps, looks] = self._run(steps, looks)
        return self._tracks[steps, looks]

    def between(self, steps: int, track: _Track) -> float:
        """How far a run of so many steps is from that of a step between its own and twice that."""
        other = self.track(_LOOKS * math.ceil(0.7 * steps / _LOOKS), _LOOKS)
        return math.inf if other is None else other.distance(track)

    def _run(self, steps: int, looks: int) -> _Track | None:
        # What blows up may overflow before it is flagged.
        with np.errstate(all="ignore"):
            track = self._follow(self._build(steps), steps // looks, looks)
        if track is None or not math.isfinite(track.distance(track)):
            return None
        return track

    def _follow(self, world: World, stride: int, looks: int) -> _Track | None:
        position, energy = [], []
        residual = kinetic = 0.0
        first = min(math.floor(looks * self._since / self._horizon + 1e-9), looks - 1)
        for look in range(looks):
            world.step(stride)
            if world.health[0]:
                return None
            position.append(landmarks(world)[0][0].copy())
            energy.append(float(world.energy[0]))
            links = world.residual[0]
            if links.size and look >= first:
                residual = max(residual, float(np.abs(links).max()))
            kinetic = max(kinetic, float(kinetic_energy(world)[0]))
        weight = 0.0
        for group in (world.particles, world.bodies) if world.scene.bodies else (world.particles,):
            pull = np.linalg.norm(group.acceleration[0], axis=1)
            weight += float(group.mass_or_zero[0] @ pull)
        scale = max(float(np.ptp(energy)), kinetic, weight * _LIFT)
        return _Track(np.stack(position[first:]), np.array(energy[first:]), residual, scale)


@dataclass(frozen=True)
class _Reference:
    """The run that is known best.

    Attributes:
        run: of which candidate.
        steps: of how many steps at least.
        error: what halving its step changed; inf where there is no run.
    """

    run: _Runs
    steps: int
    error: float

    def error_of(self, run: _Runs, steps: int) -> float:
        """Error of another run, looked at as often as its number of steps allows; inf where it broke."""
        looks = _looks(steps)
        track = run.track(steps, looks)
        true = self.run.track(looks * math.ceil(self.steps / looks), looks)
        if track is None or true is None:
            return math.inf
        error = track.distance(true) + self.error
        return error if error < _LOST else math.inf


def _looks(steps: int) -> int:
    """At how many times a run of so many steps is looked at."""
    return steps // max(1, steps // _LOOKS)


def _down(steps: int) -> int:
    """So many steps or a few less, so that looks at them are evenly spaced."""
    stride = max(1, steps // _LOOKS)
    looks = steps // stride if steps < _LOOKS**2 else _LOOKS
    return stride * max(looks, _LOOKS)


def _whole(steps: float) -> int:
    """So many steps or a few more, so that looks at them are evenly spaced."""
    least = max(math.ceil(steps), _LOOKS)
    return next(whole for whole in count(least) if _down(whole) == whole)


def _reference(runs: list[_Runs], start: int, tolerance: float, *, kinked: bool) -> _Reference:
    """The run that is known best, and its error by halving the step.

    Sweeps may leave an error that no step takes away, so their runs are no reference where others are. Behind kinks and
    impacts a step between the two counts too, and an error that grows once may fall again.
    """
    trusted = [run for run in runs if run.exact] or runs
    best = _Reference(trusted[0], start, math.inf)
    # Of one order, those that resolve impacts first.
    for run in sorted(trusted, key=lambda run: (-run.order, not run.candidate.integrator.splits)):
        steps, change, last = start, math.inf, math.inf
        before = run.track(steps, _LOOKS)
        while 2 * steps <= _MOST:
            steps *= 2
            finer = run.track(steps, _LOOKS)
            if finer is not None and before is not None:
                earlier, last, change = last, change, finer.distance(before)
                if kinked and change < best.error:
                    change = max(change, run.between(steps, finer))
                # What is left of a method of first order, and more than that of others.
                if change < best.error:
                    best = _Reference(run, steps, change)
                near = _REFERENCE * tolerance
                # Impacts may fall alike in a step and in its half.
                if change <= near and run.between(steps, finer) <= 2.0 * near:
                    return best
                if change > 0.9 * (max(earlier, last) if kinked else last):
                    break
            before = finer
    return best


def _smallest(
    run: _Runs,
    reference: _Reference,
    start: int,
    tolerance: float,
    limit: float,
    margin: _Margin,
) -> tuple[int | None, float, float]:
    """Fewest steps that hold the tolerance, at less than the cost ``limit``.

    Returns:
        The steps or None, the error there, and the least error seen.
    """
    most = margin.accept * tolerance
    tried: dict[int, float] = {}
    low, high, steps = 0, 0, start
    for _ in range(_TRIES):
        if run.cost(steps) > limit and not high:
            steps = max(_whole(low + 1), _down(int(steps * limit / run.cost(steps))))
            if steps in tried or run.cost(steps) > limit:
                break
        error = reference.error_of(run, steps)
        tried[steps] = error
        if error <= most:
            near = [_whole(factor * steps) for factor in margin.shorter]
            more = {shorter: reference.error_of(run, shorter) for shorter in near}
            lucky = [shorter for shorter, found in more.items() if found > most]
            if lucky:
                low = max(low, min(max(lucky), high - 1) if high else max(lucky))
                error = max(more.values())
            else:
                high = min(high or steps, steps)
        else:
            low = max(low, steps)
        finite = sorted((k, e) for k, e in tried.items() if reference.error < e < math.inf)
        order = float(run.order)
        if len(finite) > 1:
            (k0, e0), (k1, e1) = finite[-2:]
            order = min(max(math.log(e0 / e1) / math.log(k1 / k0), 0.5), order)
        growth = math.log(max(error, 1e-300) / (margin.aim * tolerance)) / order
        factor = 4.0 if error == math.inf else math.exp(min(growth, math.log(_FARTHEST)))
        wanted = _whole(factor * steps)
        if high:
            # What breaks below a step says nothing of how far below: the middle of what is left is next.
            broken = tried.get(low, 0.0) == math.inf
            middle = _whole(math.sqrt(max(low, 1) * high))
            wanted = middle if error == math.inf else max(wanted, middle if broken else low + 1)
            wanted = min(_whole(wanted), high)
            if wanted > 0.97 * high:
                break
        else:
            wanted = max(wanted, _whole(low + 1))
        if wanted > _MOST:
            break
        steps = wanted
    least = min(tried.values(), default=math.inf)
    return (high, tried[high], least) if high else (None, math.inf, least)


def choose_method(
    scene: Scene, *, tolerance: float, horizon: float = 1.0, since: float = 0.0
) -> Choice:
    """The cheapest method measured to hold a tolerance on a scene.

    Every method that can step the scene is run on it, from the scene's start over the horizon, at the steps that
    its order suggests; that takes seconds, and more where code must be compiled.

    Args:
        scene: what is to be stepped.
        tolerance: largest error [m] of a place (particles, and of bodies the origins and the ends of unit axes), and
            largest share of error of the energy (beside the largest of the kinetic energy, the range of the energy, and
            what lifts all by a millimetre) and of a link's length.
        horizon: how long the tolerance must hold [s].
        since: from when on errors count [s], within the horizon; for scenes that come to rest, of which only
            the rest matters.

    Returns:
        The choice, with all that was considered.

    Raises:
        TypeError: no scene.
        ValueError: no method reaches the tolerance; the message names the best that can be had.
    """
    owner = "choose_method"
    checks.instance(owner, "scene", scene, Scene, remedy="Build one.")
    allowed = checks.number(owner, "tolerance", tolerance, above=0.0, remedy="Use 1e-4.")
    span = checks.number(owner, "horizon", horizon, above=0.0, remedy="Use 1 s.")
    first = checks.number(owner, "since", since, least=0.0, most=span, remedy="Use 0 s.")
    scene.check()
    start = _LOOKS * max(1, math.ceil(60.0 * span / _LOOKS))
    runs = [_Runs(candidate, scene, span, first) for candidate in candidates(scene)]
    if any(run.candidate.integrator.divisions and not run.candidate.solver for run in runs):
        events = kinks_per_second(scene, span)
        for run in runs:
            run.events = events if run.candidate.solver is None else 0.0
    contacts = contacts_at_a_time(scene, span)
    for run in runs:
        run.contacts = contacts
    margin = _KINKED if scene.of(*_KINKS) else _SMOOTH
    reference = _reference(runs, start, allowed, kinked=margin is _KINKED)
    found: list[Considered] = []
    best, limit = reference.error, math.inf
    if reference.error <= 0.5 * allowed:
        for run in sorted(runs, key=lambda run: (-run.order, run.cost(start))):
            name = run.candidate.name
            steps, error, least = _smallest(run, reference, start, allowed, limit, margin)
            best = min(best, least)
            if steps is None:
                verdict = (
                    f"dearer than the best; {least:.2g} was seen"
                    if run.cost(_MOST) > limit
                    else f"does not hold it; {least:.2g} was seen"
                )
                found.append(Considered(name, None, math.inf, math.inf, verdict))
            else:
                found.append(Considered(name, run.dt(steps), error, run.cost(steps), "holds it"))
                limit = min(limit, run.cost(steps))
    found.sort(key=lambda entry: entry.cost)
    if not found or found[0].dt is None:
        raise ValueError(
            f"choose_method: a tolerance of {allowed:g} over {span:g} s is out of reach of every method "
            f"within {_MOST} steps; the best that can be had is {best:.2g}. Ask for that, or for a shorter horizon."
        )
    won = found[0]
    method = next(run for run in runs if run.candidate.name == won.name).candidate.at(won.dt or 0.0)
    return Choice(method, allowed, span, won.error, won.cost, tuple(found))
