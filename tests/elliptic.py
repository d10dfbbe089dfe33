"""The free asymmetric top by Jacobi's elliptic functions."""

from __future__ import annotations

import mpmath
import numpy as np

Array = np.ndarray
INERTIA = np.array([1.0, 2.0, 3.0])


def elliptic_spin(spin: Array, time: float) -> Array:
    """Angular velocity of the free top with moments 1, 2, 3 whose axis 2 is the unstable one, by Jacobi's functions.

    For 2 E I2 > L^2 the motion runs about axis 1, else about axis 3; the phase follows from the start.
    """
    with mpmath.workdps(40):
        i1, i2, i3 = (mpmath.mpf(float(i)) for i in INERTIA)
        w1, w2, w3 = (mpmath.mpf(float(w)) for w in spin)
        energy = i1 * w1**2 + i2 * w2**2 + i3 * w3**2
        square = (i1 * w1) ** 2 + (i2 * w2) ** 2 + (i3 * w3) ** 2
        if square < energy * i2:
            # Axes 1 and 3 change roles.
            i1, i3, w1, w3 = i3, i1, w3, w1
        a1 = mpmath.sqrt((energy * i3 - square) / (i1 * (i3 - i1)))
        a2 = mpmath.sqrt((energy * i3 - square) / (i2 * (i3 - i2)))
        a3 = mpmath.sqrt((square - energy * i1) / (i3 * (i3 - i1)))
        rate = mpmath.sqrt((i3 - i2) * (square - energy * i1) / (i1 * i2 * i3))
        m = (i2 - i1) * (energy * i3 - square) / ((i3 - i2) * (square - energy * i1))
        # w1 = s1 a1 cn, w2 = s2 a2 sn, w3 = s3 a3 dn of u = rate t + u0.
        s1, s3 = mpmath.sign(w1), mpmath.sign(w3)
        s2 = s1 * s3
        amplitude = mpmath.asin(s2 * w2 / a2)
        u0 = mpmath.ellipf(amplitude, m)
        u = rate * mpmath.mpf(time) + u0
        found = [
            s1 * a1 * mpmath.ellipfun("cn", u, m=m),
            s2 * a2 * mpmath.ellipfun("sn", u, m=m),
            s3 * a3 * mpmath.ellipfun("dn", u, m=m),
        ]
        if i1 > i3:
            found.reverse()
        return np.array([float(x) for x in found])
