"""Trusted solutions of the benchmark scenes: closed forms, statics, and ODEs solved far below any
error that is charted."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mpmath
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

from benchmarks.scenes import Array, ParticleScene

# Digits carried by the closed forms. Rounding the result to double is then the only error: the
# projectile loses some 5 digits to cancellation, a stiff oscillator as many as its phase has.
DIGITS = 60

# scipy takes no relative tolerance below 100 rounding units.
RIGID_TOLERANCE = 2.5e-14


def rigid_motion(scene: ParticleScene, time: ArrayLike) -> tuple[Array, Array]:
    """Motion of particles that rods join into one free rigid body.

    Euler's equations and the quaternion's, by DOP853 near the limit of double precision. The centre
    of mass follows uniform acceleration; the scene must have no damping.

    Args:
        scene: Particles whose velocities are those of a rigid body; links are not read.
        time: Times [s] from 0 upwards, shape (times,).

    Returns:
        Positions [m] and velocities [m/s], each of shape (times, particles, 3).

    Raises:
        ValueError: The scene is damped or its velocities deform it.
    """
    if scene.damping != 1.0:
        raise ValueError(f"damping is {scene.damping}: a rigid reference needs 1.")
    times = np.atleast_1d(np.asarray(time, dtype=np.float64))
    total = scene.mass.sum()
    centre = scene.mass @ scene.position / total
    drift = scene.mass @ scene.velocity / total
    arm = scene.position - centre
    inertia = np.einsum("p,p,ij->ij", scene.mass, (arm**2).sum(axis=1), np.eye(3)) - np.einsum(
        "p,pi,pj->ij", scene.mass, arm, arm
    )
    momentum = scene.mass @ np.cross(arm, scene.velocity - drift)
    spin = np.linalg.solve(inertia, momentum)
    mismatch = np.abs(np.cross(spin, arm) + drift - scene.velocity).max()
    if mismatch > 1e-12 * (1.0 + np.abs(scene.velocity).max()):
        raise ValueError(f"The velocities deform the body by {mismatch} m/s: make them rigid.")

    def rate(_: float, state: Array) -> Array:
        scalar, vector, body_spin = state[0], state[1:4], state[4:]
        return np.concatenate(
            [
                [-0.5 * vector @ body_spin],
                0.5 * (scalar * body_spin + np.cross(vector, body_spin)),
                np.linalg.solve(inertia, np.cross(inertia @ body_spin, body_spin)),
            ]
        )

    solution = solve_ivp(
        rate,
        (0.0, max(float(times.max()), np.finfo(np.float64).tiny)),
        np.concatenate([[1.0, 0.0, 0.0, 0.0], spin]),
        method="DOP853",
        t_eval=times,
        rtol=RIGID_TOLERANCE,
        atol=RIGID_TOLERANCE,
        # Times between steps are interpolated at a lower order, so the steps are kept short.
        max_step=0.01,
    )
    gravity = np.asarray(scene.gravity)
    position = np.empty((len(times), *arm.shape))
    velocity = np.empty_like(position)
    for i, (t, state) in enumerate(zip(times, solution.y.T, strict=True)):
        rotation = _rotation(state[:4])
        turned = arm @ rotation.T
        position[i] = centre + drift * t + 0.5 * gravity * t**2 + turned
        velocity[i] = drift + gravity * t + np.cross(rotation @ state[4:], turned)
    return position, velocity


def _rotation(quaternion: Array) -> Array:
    """Rotation matrix of a quaternion (scalar first) that need not have unit length."""
    scalar, x, y, z = quaternion / np.linalg.norm(quaternion)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + 2.0 * scalar * cross + 2.0 * cross @ cross


@dataclass(frozen=True, kw_only=True)
class Equilibrium:
    """A scene at rest with every link taut.

    Attributes:
        position: Particle positions [m], shape (particles, 3).
        rod_tension: Force along each rod [N], positive where the rod pulls, shape (rods,).
        cable_tension: The same for cables between particles, shape (cables,).
        support_tension: The same for cables to anchors, shape (supports,).
        residual: Greatest unbalanced force [N] or length error [m].
    """

    position: Array
    rod_tension: Array
    cable_tension: Array
    support_tension: Array
    residual: float


def equilibrium(scene: ParticleScene) -> Equilibrium:
    """Solve the statics of a scene of which every rod and cable is taut, as the bridge is.

    Newton's method on positions and tensions per length together: the weights balance the links,
    and each link has its length. The unknowns enter at most quadratically.

    Raises:
        ArithmeticError: The iteration did not settle, or a cable would have to push.
    """
    count = len(scene.mass)
    # The vectors along the links are incidence @ position - anchor.
    incidence, anchor, length = scene.spans()
    weight = np.outer(scene.mass, scene.gravity)
    position = scene.position.copy()
    density = np.ones(len(length))

    residual = math.inf
    for _ in range(100):
        span = incidence @ position - anchor
        jacobian = (incidence[:, :, None] * span[:, None, :]).reshape(len(length), 3 * count)
        balance = weight.ravel() - jacobian.T @ density
        excess = 0.5 * ((span**2).sum(axis=1) - length**2)
        error = float(max(np.abs(balance).max(), np.abs(excess / length).max()))
        # Settled: no longer falling, and at what rounding leaves of forces of about 100 N.
        if error >= residual and residual < 1e-11:
            break
        residual = error
        stiffness = np.kron(incidence.T @ (density[:, None] * incidence), np.eye(3))
        matrix = np.block([[stiffness, jacobian.T], [jacobian, np.zeros((len(length),) * 2)]])
        change = np.linalg.solve(matrix, np.concatenate([balance, -excess]))
        position = position + change[: 3 * count].reshape(count, 3)
        density = density + change[3 * count :]
    else:
        raise ArithmeticError(f"The statics did not settle: residual {residual} after 100 steps.")
    tension = density * length
    rods = len(scene.rods)
    cables = rods + len(scene.pins)
    supports = cables + len(scene.cables)
    if tension[cables:].size and tension[cables:].min() < 0.0:
        raise ArithmeticError(
            f"A cable would push with {-tension[cables:].min()} N: it hangs slack, leave it out."
        )
    return Equilibrium(
        position=position,
        rod_tension=tension[:rods],
        cable_tension=tension[cables:supports],
        support_tension=tension[supports:],
        residual=residual,
    )


def projectile(
    position: ArrayLike,
    velocity: ArrayLike,
    *,
    acceleration: ArrayLike,
    damping: float,
    time: float,
) -> tuple[Array, Array]:
    """A particle under constant acceleration whose velocity keeps the share `damping` per second.

    v' = a - c v with c = -ln(damping), solved in closed form with 60 digits.

    Args:
        position: Position at time 0 [m], shape (3,).
        velocity: Velocity at time 0 [m/s], shape (3,).
        acceleration: Constant acceleration [m/s^2], shape (3,).
        damping: Share of the velocity kept over one second, in (0, 1].
        time: Time [s].

    Returns:
        Position [m] and velocity [m/s] at `time`, each of shape (3,).
    """
    with mpmath.workdps(DIGITS):
        c, t = -mpmath.log(damping), mpmath.mpf(time)
        axes = zip(_exact(position), _exact(velocity), _exact(acceleration), strict=True)
        place, speed = zip(*(_damped_flight(x, v, a, c, t) for x, v, a in axes), strict=True)
        return np.array(place, dtype=np.float64), np.array(speed, dtype=np.float64)


def projectile_impact(
    position: ArrayLike, velocity: ArrayLike, *, acceleration: ArrayLike, damping: float
) -> tuple[float, Array]:
    """Time [s] and place [m], shape (3,), at which a falling projectile comes down to y = 0.

    With c = -ln(damping), final speed w = -a_y / c, K = (v_y + w) / w and H = y c / w, the height
    is zero at t = (K + H + W0(-K exp(-K - H))) / c, where W0 is Lambert's function. Arguments as in
    `projectile`; the damping must be below 1 and the acceleration must point down.
    """
    if not 0.0 < damping < 1.0:
        raise ValueError(f"damping is {damping}: the impact by Lambert's W needs 0 < damping < 1.")
    fall = float(np.asarray(acceleration)[1])
    if fall >= 0.0:
        raise ValueError(f"acceleration along y is {fall}: an impact needs one below 0.")
    with mpmath.workdps(DIGITS):
        places, speeds, pulls = _exact(position), _exact(velocity), _exact(acceleration)
        c = -mpmath.log(damping)
        final_speed = -pulls[1] / c
        k = speeds[1] / final_speed + 1
        h = places[1] * c / final_speed
        time = mpmath.re(k + h + mpmath.lambertw(-k * mpmath.exp(-k - h))) / c
        axes = zip(places, speeds, pulls, strict=True)
        place = [_damped_flight(x, v, a, c, time)[0] for x, v, a in axes]
        return float(time), np.array(place, dtype=np.float64)


def _exact(vector: ArrayLike) -> list[mpmath.mpf]:
    return [mpmath.mpf(number) for number in np.asarray(vector, dtype=np.float64).tolist()]


def _damped_flight(
    x: mpmath.mpf, v: mpmath.mpf, a: mpmath.mpf, c: mpmath.mpf, t: mpmath.mpf
) -> tuple[mpmath.mpf, mpmath.mpf]:
    """One axis of v' = a - c v after the time t."""
    if c == 0:
        return x + v * t + a * t**2 / 2, v + a * t
    decay = -mpmath.expm1(-c * t)
    return x + a / c * t + (v - a / c) * decay / c, v + (a / c - v) * decay


def oscillator(
    position: float,
    velocity: float,
    *,
    stiffness: float,
    damping: float,
    mass: float,
    time: float,
) -> tuple[float, float]:
    """The damped oscillator m x'' = -k x - c x', with 60 digits.

    One formula serves light, critical and heavy damping: with b = c / 2m and s = sqrt(b^2 - k/m),
    complex where damping is light, x = exp(-b t) (x0 cosh(s t) + (v0 + b x0) sinh(s t) / s).

    Args:
        position: Displacement at time 0 [m].
        velocity: Velocity at time 0 [m/s].
        stiffness: k [N/m].
        damping: c [N s/m].
        mass: m [kg].
        time: Time [s].

    Returns:
        Displacement [m] and velocity [m/s] at `time`.
    """
    with mpmath.workdps(DIGITS):
        x, v, t = mpmath.mpf(position), mpmath.mpf(velocity), mpmath.mpf(time)
        square = mpmath.mpf(stiffness) / mpmath.mpf(mass)
        b = mpmath.mpf(damping) / (2 * mpmath.mpf(mass))
        s = mpmath.sqrt(mpmath.mpc(b**2 - square))
        cosine = mpmath.cosh(s * t)
        sine = t if s == 0 else mpmath.sinh(s * t) / s
        decay = mpmath.exp(-b * t)
        return (
            float(mpmath.re(decay * (x * cosine + (v + b * x) * sine))),
            float(mpmath.re(decay * (v * cosine - (square * x + b * v) * sine))),
        )


def pendulum_period(amplitude: float, *, length: float, gravity: float = 9.81) -> float:
    """Period [s] of an undamped pendulum that is released from rest at `amplitude` [rad]."""
    return 4.0 * math.sqrt(length / gravity) * float(ellipk(math.sin(0.5 * amplitude) ** 2))


def pendulum(
    time: ArrayLike, *, length: float, amplitude: float = 0.5 * math.pi, gravity: float = 9.81
) -> tuple[Array, Array]:
    """An undamped pendulum that is released from rest, in Jacobi's elliptic functions.

    sin(angle / 2) = k cd(w t | k^2), with k = sin(amplitude / 2) and w = sqrt(gravity / length).

    Args:
        time: Times [s], shape (times,).
        length: Length [m].
        amplitude: Angle at release, from the hanging position, below pi [rad].
        gravity: [m/s^2].

    Returns:
        Angle [rad] and angular velocity [rad/s], each of shape (times,).
    """
    k = math.sin(0.5 * amplitude)
    frequency = math.sqrt(gravity / length)
    sn, cn, dn, _ = ellipj(frequency * np.asarray(time, dtype=np.float64), k * k)
    angle = 2.0 * np.arcsin(k * cn / dn)
    return angle, -2.0 * frequency * k * math.sqrt(1.0 - k * k) * sn / dn
