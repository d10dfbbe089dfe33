"""The tree of boxes against trying all, while things come, go and move."""

import numpy as np
import pytest

from steelyard.collision.hierarchy import Hierarchy


def brute(boxes, low, high):
    return [k for k, (a, b) in sorted(boxes.items()) if (a <= high).all() and (low <= b).all()]


@pytest.mark.parametrize("seed", range(5))
def test_a_tree_knows_what_trying_all_finds(seed):
    rng = np.random.default_rng(seed)
    tree, boxes = Hierarchy(60), {}
    for _ in range(600):
        thing = int(rng.integers(60))
        low = rng.uniform(-10, 10, 3)
        high = low + rng.uniform(0, 3, 3)
        if thing not in boxes:
            tree.insert(thing, low, high)
            boxes[thing] = (low, high)
        elif rng.random() < 0.5:
            tree.remove(thing)
            del boxes[thing]
        else:
            assert tree.refit(thing, low, high)
            boxes[thing] = (low, high)
        low = rng.uniform(-12, 10, 3)
        high = low + rng.uniform(0, 8, 3)
        assert tree.meeting(low, high).tolist() == brute(boxes, low, high)


def test_a_row_of_things_makes_no_list_of_the_tree():
    """Put in by order along a line, the worst that can come."""
    tree = Hierarchy(1024)
    for k in range(1024):
        tree.insert(k, np.array([k, 0, 0.0]), np.array([k + 0.5, 1, 1]))
    assert tree.depth <= 24
    for k in range(0, 1024, 2):
        tree.remove(k)
    assert tree.meeting(np.array([10.0, 0, 0]), np.array([14.2, 1, 1])).tolist() == [11, 13]


def test_small_moves_within_the_margin_change_nothing():
    tree = Hierarchy(3, margin=0.1)
    low, high = np.zeros(3), np.ones(3)
    for k in range(3):
        tree.insert(k, low + 5 * k, high + 5 * k)
    assert not tree.refit(1, low + 5.05, high + 5.05)
    assert tree.refit(1, low + 5.2, high + 5.2)


def test_things_are_in_once():
    tree = Hierarchy(2)
    tree.insert(0, np.zeros(3), np.ones(3))
    with pytest.raises(ValueError, match="0 is in already"):
        tree.insert(0, np.zeros(3), np.ones(3))
    with pytest.raises(ValueError, match="1 is not in"):
        tree.remove(1)
    tree.remove(0)
    assert tree.meeting(np.zeros(3), np.ones(3)).tolist() == []
    assert tree.depth == 0
