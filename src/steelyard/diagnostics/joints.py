"""Joints: what they bear after a step, how far they are open, and where what they leave free stands."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..scene.body import Body
from ..scene.joints import ANGLE, DISTANCE, JOINTS, SHIFTS, Drive, named_drives
from ..scene.shapes import rotation_matrix

if TYPE_CHECKING:
    from ..world import World


@dataclass(frozen=True)
class Joints:
    """All joints of all worlds.

    Attributes:
        joints: in the order of the scene.
        drives: (joint, drive) of everything that joints leave free and drive, in the order of ``coordinate``.
        gap: largest distance by which a joint's places are apart [m], or by which a distance is off, (worlds, joints).
        twist: largest angle by which its axes are [rad], (worlds, joints).
        coordinate: shift [m], angle [rad] or distance [m] of each drive, (worlds, drives).
        rate: how fast these change, (worlds, drives).
        force: on the joint's a, in the second half of the last step [N], (worlds, joints, 3); on its b the opposite.
        torque: the same of couples, with those of motors and springs [N m], (worlds, joints, 3).
        broken: (worlds, joints) bool.
    """

    joints: tuple[Any, ...]
    drives: tuple[tuple[Any, Drive], ...]
    gap: np.ndarray
    twist: np.ndarray
    coordinate: np.ndarray
    rate: np.ndarray
    force: np.ndarray
    torque: np.ndarray
    broken: np.ndarray


@dataclass(frozen=True)
class _End:
    """A joint's frame on one side: place (worlds, 3), axes in columns (worlds, 3, 3) and their velocities."""

    place: np.ndarray
    axes: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray


def joints_of(world: World) -> Joints:
    """See ``World.joints``."""
    return _state_of(world, tuple(world.scene.of(*JOINTS)))


def _state_of(world: World, joints: tuple[Any, ...]) -> Joints:
    """Of some of the joints."""
    turns = rotation_matrix(world.bodies.orientation) if world.scene.bodies else None
    spins = world.bodies.angular_velocity if world.scene.bodies else None
    gaps, twists, drives = [], [], []
    coordinates, rates = [], []
    for joint in joints:
        a, b = (_end(world, turns, spins, *end) for end in joint.ends)
        locked = joint.locked
        off = [_coordinate(a, b, c)[0] for c in SHIFTS if c in locked]
        if DISTANCE in locked:
            off.append(_coordinate(a, b, DISTANCE)[0] - world[joint].length)
        gaps.append(np.linalg.norm(off, axis=0) if off else np.zeros(world.worlds))
        turned = [_alignment(a, b, c) for c in locked if c not in (*SHIFTS, DISTANCE)]
        twists.append(np.max(np.abs(turned), axis=0) if turned else np.zeros(world.worlds))
        for drive in joint.drives:
            value, rate = _coordinate(a, b, drive.coordinate)
            drives.append((joint, drive))
            coordinates.append(value)
            rates.append(rate)

    def columns(values: list[np.ndarray]) -> np.ndarray:
        return np.stack(values, axis=1) if values else np.zeros((world.worlds, 0))

    def each(name: str) -> np.ndarray:
        if not joints:
            return np.zeros((world.worlds, 0, 3))
        return np.stack([world._view(joint, name) for joint in joints], axis=1)

    return Joints(
        joints=joints,
        drives=tuple(drives),
        gap=columns(gaps),
        twist=columns(twists),
        coordinate=columns(coordinates),
        rate=columns(rates),
        force=each("force"),
        torque=each("torque"),
        broken=columns([world[joint].broken > 0.0 for joint in joints]) > 0.0,
    )


def drive_energy(world: World) -> np.ndarray:
    """k (c - rest)^2 / 2 of the springs of joints [J], shape (worlds,)."""
    total = np.zeros(world.worlds)
    driven = tuple(joint for joint in world.scene.of(*JOINTS) if joint.drives)
    if not driven:
        return total
    state = _state_of(world, driven)
    prefixes = {id(d): prefix for joint in state.joints for prefix, d in named_drives(joint)}
    for k, (joint, drive) in enumerate(state.drives):
        handle, prefix = world[joint], prefixes[id(drive)]
        stretch = state.coordinate[:, k] - getattr(handle, f"{prefix}rest")
        stiffness = np.where(handle.broken > 0.0, 0.0, getattr(handle, f"{prefix}stiffness"))
        total = total + 0.5 * stiffness * stretch**2
    return total


def _end(
    world: World, turns: Any, spins: Any, thing: Any, place: np.ndarray, axes: np.ndarray
) -> _End:
    """One side's frame in the world."""
    zero = np.zeros((world.worlds, 3))
    if thing is None:
        return _End(zero + place, zero[..., None] + axes, zero, zero)
    k = world._index(thing)
    if not isinstance(thing, Body):
        particles = world.particles
        return _End(
            particles.position[:, k], zero[..., None] + axes, particles.velocity[:, k], zero
        )
    turn, spin = turns[:, k], spins[:, k]
    arm = turn @ place
    velocity = world.bodies.velocity[:, k] + np.cross(spin, arm)
    return _End(world.bodies.position[:, k] + arm, turn @ axes, velocity, spin)


def _coordinate(a: _End, b: _End, c: int) -> tuple[np.ndarray, np.ndarray]:
    """A coordinate of a's frame against b's, and its rate."""
    apart, spin = a.place - b.place, a.spin - b.spin
    if c == ANGLE:
        across, along = a.axes[..., 1], b.axes
        angle = np.arctan2((across * along[..., 2]).sum(-1), (across * along[..., 1]).sum(-1))
        return angle, (a.axes[..., 0] * spin).sum(-1)
    velocity = a.velocity - b.velocity
    if c == DISTANCE:
        distance = np.linalg.norm(apart, axis=-1)
        return distance, (apart * velocity).sum(-1) / distance
    # Seen from b, which turns.
    velocity = velocity - np.cross(b.spin, apart)
    return (b.axes[..., c] * apart).sum(-1), (b.axes[..., c] * velocity).sum(-1)


def _alignment(a: _End, b: _End, c: int) -> np.ndarray:
    """Of locked turns: products of axes that are 0 where these are aligned."""
    own, other = a.axes[..., 1 if c == 5 else 0], b.axes[..., 1 if c == 3 else 2]
    return np.asarray((own * other).sum(-1))
