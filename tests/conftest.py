"""Settings that hold for every test."""

import os

# Read by pygame and matplotlib when first imported: no test may open a window.
os.environ["SDL_VIDEODRIVER"] = "dummy"
os.environ["MPLBACKEND"] = "Agg"
# Parallel workers already use every core; torch threads on top of them only wait for each other.
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OMP_NUM_THREADS", "1")

from hypothesis import settings

# No deadline: the first example of a test may compile kernels for seconds.
settings.register_profile("steelyard", deadline=None)
settings.register_profile(
    "steelyard-ci", deadline=None, derandomize=True, database=None, print_blob=True
)
settings.load_profile("steelyard-ci" if os.environ.get("CI") else "steelyard")
