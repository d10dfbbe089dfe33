"""Where methods fail: boundaries found by bisection in batches, against the theory, as pictures and data."""
