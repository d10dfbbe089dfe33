"""Demo scenes as functions that return a Scene, and the sharing of loads over decks."""

from .ballistic import SHOTS, ballistic
from .bridge import bridge, bridge_weights
from .cloth import cloth
from .loads import bilinear_weights, lumped_masses
from .platform import platform
from .ragdoll import ragdoll

__all__ = [
    "SHOTS",
    "ballistic",
    "bilinear_weights",
    "bridge",
    "bridge_weights",
    "cloth",
    "lumped_masses",
    "platform",
    "ragdoll",
]
