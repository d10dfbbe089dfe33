"""What is run against MuJoCo: the motions, the methods on both sides and the ladders of steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import steelyard as sy
from benchmarks import cases
from benchmarks.cases import Case
from benchmarks.flights import PeerMethod

WORLDS = 1024
#: The step at which the targets compare [s].
DT = 0.01

Methods = dict[str, Callable[[float], sy.Method]]
LINKED: Methods = {
    "Rattle, Direct": lambda dt: sy.Method(sy.Rattle(), sy.Direct(), dt=dt),
    "Rattle, Direct to 1e-6": lambda dt: sy.Method(sy.Rattle(), sy.Direct(tolerance=1e-6), dt=dt),
    "Rattle, Gauss-Seidel x 4": lambda dt: sy.Method(sy.Rattle(), sy.GaussSeidel(passes=4), dt=dt),
}
FREE: Methods = {
    "closed form": lambda dt: sy.Method(sy.ClosedForm(), dt=dt),
    "Rattle": lambda dt: sy.Method(sy.Rattle(), dt=dt),
}
PEERS_LINKED = {
    f"MuJoCo {integrator}, {links} links": PeerMethod(integrator=integrator, links=links)
    for integrator in ("Euler", "RK4")
    for links in ("default", "safe", "tight")
}
PEERS_FREE = {
    "MuJoCo Euler": PeerMethod(integrator="Euler"),
    "MuJoCo RK4": PeerMethod(integrator="RK4"),
}


@dataclass(frozen=True, kw_only=True)
class Contest:
    """What is run on a case.

    Attributes:
        case: The motion, given the number of worlds.
        methods: Our methods, given dt, by name; the first is the default one.
        peers: MuJoCo's settings by name; the first is its default one.
        steps: Our ladder, in steps per stretch.
        peer_steps: MuJoCo's.
        limit_steps: Steps per stretch of MuJoCo's own motion at small steps; None where its links
            are not soft.
        crowd: Worlds side by side in one model of MuJoCo, where it was found to be fastest.
        target: Smallest ratio of costs to be reached.
        at_equal_step: Whether the target compares both at `DT`, instead of our cheapest point of no
            larger error. For a method that is exact at any step this is the harder comparison.
    """

    case: Callable[[int], Case]
    methods: Methods
    peers: Mapping[str, PeerMethod]
    steps: Sequence[int]
    peer_steps: Sequence[int]
    limit_steps: int | None
    crowd: int
    target: float
    at_equal_step: bool = False


CONTESTS = {
    "platform": Contest(
        case=cases.platform,
        methods=LINKED,
        peers=PEERS_LINKED,
        steps=(10, 12, 14, 17, 20, 25, 35, 50, 100, 200, 250),
        peer_steps=(25, 50, 100, 200),
        limit_steps=1600,
        crowd=2,
        target=50.0,
    ),
    "bridge": Contest(
        case=cases.bridge,
        methods=LINKED,
        peers=PEERS_LINKED,
        steps=(1, 2, 3, 4, 8, 16),
        peer_steps=(2, 4, 8, 16),
        limit_steps=128,
        crowd=16,
        target=40.0,
    ),
    "ballistic": Contest(
        case=cases.ballistic,
        methods=FREE,
        peers=PEERS_FREE,
        steps=(1, 10, 100),
        peer_steps=(1, 10, 100),
        limit_steps=None,
        crowd=1024,
        target=100.0,
        at_equal_step=True,
    ),
}
