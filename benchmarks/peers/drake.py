"""Drake where it is installed, which is optional (extra `drake`): it takes a second to load, so not before it flies."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import steelyard as sy

if TYPE_CHECKING:
    from benchmarks.peers.drake_bodies import DrakeFlight

INSTALLED = find_spec("pydrake") is not None
#: How it steps what touches, by name: scheme and accuracy. At 1e-7 CENIC steps a stack by microseconds.
WAYS: dict[str, dict[str, Any]] = {
    "Drake SAP": {"scheme": "sap"},
    "Drake CENIC 1e-3": {"scheme": "cenic", "accuracy": 1e-3},
    "Drake CENIC 1e-5": {"scheme": "cenic", "accuracy": 1e-5},
}


def flight(scene: sy.Scene, dt: float, way: dict[str, Any]) -> DrakeFlight:
    """A rigid scene flown by Drake in one of its ways, in steps of at most dt [s]."""
    from benchmarks.peers.drake_bodies import DrakeFlight, DrakeSettings

    return DrakeFlight(scene, DrakeSettings(dt=dt, **way))
