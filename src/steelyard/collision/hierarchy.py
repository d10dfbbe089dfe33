"""A tree of boxes over things: what meets a box or lies on a path is found without trying all.

Leaves are the things; every other node is the box about two more. A thing goes in beside the node that this enlarges
least; on the way back up, a child changes places with a grandchild where that makes boxes smaller, which keeps the tree
even. Moving a thing takes it out and puts it in again only where it has left its box.

A tree of so many ``leaves`` stands in integers ``n`` from the entry ``tree`` on: its head, then three words of each
node; and its boxes in numbers ``s`` from the entry ``boxes`` on: two corners of each node [m].

Source: Catto (2019), *Dynamic Bounding Volume Hierarchies*; Goldsmith & Salmon (1987) for the cost.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from ..kernel import inner, kernel

_PARENT, _LEFT, _RIGHT, _NODE = range(4)
#: Numbers of a box.
BOX_NUMBERS = 6
# Words of the head: root, first free inner node, and whether the tree was cleared once.
_ROOT, _FREE, _READY, _HEAD = range(4)
#: Nodes that a walk may have before it: more than any tree of rotations is deep, which no walk checks.
STACK = 256


@register_jitable
def tree_words(leaves: int) -> int:
    """Integers that a tree takes."""
    return _HEAD + _NODE * max(2 * leaves - 1, 1)


@register_jitable
def tree_numbers(leaves: int) -> int:
    """Numbers that its boxes take."""
    return BOX_NUMBERS * max(2 * leaves - 1, 1)


@inner
def _word(tree, node, which):
    """Entry of a node's word."""
    return tree + _HEAD + _NODE * node + which


@inner
def _area(s, boxes, i):
    """Half the surface of a box."""
    b = boxes + BOX_NUMBERS * i
    x = s[b + 3] - s[b]
    y = s[b + 4] - s[b + 1]
    z = s[b + 5] - s[b + 2]
    return x * y + y * z + z * x


@inner
def _joint_area(s, boxes, i, j):
    """Half the surface of the box about two."""
    a = boxes + BOX_NUMBERS * i
    b = boxes + BOX_NUMBERS * j
    x = max(s[a + 3], s[b + 3]) - min(s[a], s[b])
    y = max(s[a + 4], s[b + 4]) - min(s[a + 1], s[b + 1])
    z = max(s[a + 5], s[b + 5]) - min(s[a + 2], s[b + 2])
    return x * y + y * z + z * x


@inner
def _join(n, tree, s, boxes, i):
    """Make a node's box that about its children."""
    own = boxes + BOX_NUMBERS * i
    left = boxes + BOX_NUMBERS * n[_word(tree, i, _LEFT)]
    right = boxes + BOX_NUMBERS * n[_word(tree, i, _RIGHT)]
    for k in range(3):
        s[own + k] = min(s[left + k], s[right + k])
        s[own + 3 + k] = max(s[left + 3 + k], s[right + 3 + k])


@inner
def _swap(n, tree, node, side, child, child_side):
    """Let a child of a node and a child of its other child change places."""
    one = n[_word(tree, node, side)]
    two = n[_word(tree, child, child_side)]
    n[_word(tree, node, side)] = two
    n[_word(tree, two, _PARENT)] = node
    n[_word(tree, child, child_side)] = one
    n[_word(tree, one, _PARENT)] = child


@inner
def _rotate(n, tree, s, boxes, leaves, node):
    """The exchange of a child with a grandchild that makes the other child smallest, if any does."""
    best = 0.0
    best_side = -1
    best_child = -1
    best_child_side = -1
    for side in range(_LEFT, _RIGHT + 1):
        child = n[_word(tree, node, _LEFT + _RIGHT - side)]
        if child >= leaves:
            area = _area(s, boxes, child)
            for child_side in range(_LEFT, _RIGHT + 1):
                # What stays below the child is its other one, beside the node's.
                stays = n[_word(tree, child, _LEFT + _RIGHT - child_side)]
                gain = area - _joint_area(s, boxes, n[_word(tree, node, side)], stays)
                if gain > best:
                    best = gain
                    best_side = side
                    best_child = child
                    best_child_side = child_side
    if best_side >= 0:
        _swap(n, tree, node, best_side, best_child, best_child_side)
        _join(n, tree, s, boxes, best_child)


@inner
def _mend(n, tree, s, boxes, leaves, node):
    """Boxes and balance from a node up to the root."""
    while node >= 0:
        _join(n, tree, s, boxes, node)
        _rotate(n, tree, s, boxes, leaves, node)
        node = n[_word(tree, node, _PARENT)]


@inner
def _sibling(n, tree, s, boxes, leaves, leaf):
    """The node beside which a leaf enlarges the tree least, going down greedily."""
    node = n[tree + _ROOT]
    while node >= leaves:
        joint = _joint_area(s, boxes, node, leaf)
        # Beside this node; or below, where it grows with all that is above.
        here = joint
        inherited = joint - _area(s, boxes, node)
        best = 1e300
        best_child = -1
        for side in range(_LEFT, _RIGHT + 1):
            child = n[_word(tree, node, side)]
            cost = _joint_area(s, boxes, child, leaf) + inherited
            if child >= leaves:
                cost -= _area(s, boxes, child)
            if cost < best:
                best = cost
                best_child = child
        # Areas of what is too far to be told apart are no numbers.
        if best_child < 0 or here <= best:
            break
        node = best_child
    return node


@inner
def clear_tree(n, tree, leaves):
    """A tree without leaves."""
    n[tree + _ROOT] = -1
    n[tree + _FREE] = leaves if leaves > 1 else -1
    n[tree + _READY] = 1
    for i in range(leaves, 2 * leaves - 1):
        n[_word(tree, i, _PARENT)] = i + 1 if i + 1 < 2 * leaves - 1 else -1
    for i in range(leaves):
        n[_word(tree, i, _PARENT)] = -1


@inner
def is_ready(n, tree):
    """Whether a tree in memory that began with zeros was cleared once."""
    return n[tree + _READY] != 0


@inner
def is_within(n, tree, leaf):
    """Whether a leaf is in the tree."""
    return n[_word(tree, leaf, _PARENT)] >= 0 or n[tree + _ROOT] == leaf


@inner
def insert_leaf(n, tree, s, boxes, leaves, leaf):
    """Put a leaf into the tree, whose box is written."""
    if n[tree + _ROOT] < 0:
        n[tree + _ROOT] = leaf
        n[_word(tree, leaf, _PARENT)] = -1
        return
    beside = _sibling(n, tree, s, boxes, leaves, leaf)
    above = n[_word(tree, beside, _PARENT)]
    node = n[tree + _FREE]
    n[tree + _FREE] = n[_word(tree, node, _PARENT)]
    n[_word(tree, node, _PARENT)] = above
    n[_word(tree, node, _LEFT)] = beside
    n[_word(tree, node, _RIGHT)] = leaf
    n[_word(tree, beside, _PARENT)] = node
    n[_word(tree, leaf, _PARENT)] = node
    _replace(n, tree, above, beside, node)
    _mend(n, tree, s, boxes, leaves, node)


@inner
def _replace(n, tree, above, old, new):
    """Let a node be the child of that above the old one, or the root."""
    if above < 0:
        n[tree + _ROOT] = new
    elif n[_word(tree, above, _LEFT)] == old:
        n[_word(tree, above, _LEFT)] = new
    else:
        n[_word(tree, above, _RIGHT)] = new


@inner
def remove_leaf(n, tree, s, boxes, leaves, leaf):
    """Take a leaf out of the tree."""
    node = n[_word(tree, leaf, _PARENT)]
    n[_word(tree, leaf, _PARENT)] = -1
    if node < 0:
        n[tree + _ROOT] = -1
        return
    other = n[_word(tree, node, _LEFT)] + n[_word(tree, node, _RIGHT)] - leaf
    above = n[_word(tree, node, _PARENT)]
    n[_word(tree, other, _PARENT)] = above
    _replace(n, tree, above, node, other)
    n[_word(tree, node, _PARENT)] = n[tree + _FREE]
    n[tree + _FREE] = node
    _mend(n, tree, s, boxes, leaves, above)


@inner
def children(n, tree, node):
    """Both children of a node that is no leaf."""
    return n[_word(tree, node, _LEFT)], n[_word(tree, node, _RIGHT)]


@inner
def root_of(n, tree):
    """The root, or -1 of a tree without leaves."""
    return n[tree + _ROOT]


@inner
def box_of(boxes, node):
    """First entry of a node's box."""
    return boxes + BOX_NUMBERS * node


@inner
def meets(s, one, other):
    """Whether two boxes meet, given their first entries."""
    return (
        s[one] <= s[other + 3]
        and s[other] <= s[one + 3]
        and s[one + 1] <= s[other + 4]
        and s[other + 1] <= s[one + 4]
        and s[one + 2] <= s[other + 5]
        and s[other + 2] <= s[one + 5]
    )


@inner
def find_meeting(n, tree, s, boxes, leaves, box, stack, found):
    """Leaves whose boxes meet that at entry ``box``, into the integers from ``found`` on, ascending; how many."""
    count = 0
    if n[tree + _ROOT] < 0:
        return count
    n[stack] = n[tree + _ROOT]
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = n[stack + waiting]
        if meets(s, box_of(boxes, node), box):
            if node < leaves:
                # Few are found: put in their places as they come.
                place = count
                while place > 0 and n[found + place - 1] > node:
                    n[found + place] = n[found + place - 1]
                    place -= 1
                n[found + place] = node
                count += 1
            else:
                left, right = children(n, tree, node)
                n[stack + waiting] = left
                n[stack + waiting + 1] = right
                waiting += 2
    return count


@kernel
def _clear(n, leaves):
    clear_tree(n, 0, leaves)


@kernel
def _is_within(n, leaf):
    return is_within(n, 0, leaf)


@kernel
def _insert(n, s, leaves, leaf):
    insert_leaf(n, 0, s, 0, leaves, leaf)


@kernel
def _remove(n, s, leaves, leaf):
    remove_leaf(n, 0, s, 0, leaves, leaf)


@kernel
def _meeting(n, s, leaves, box, stack, found):
    return find_meeting(n, 0, s, 0, leaves, box, stack, found)


class Hierarchy:
    """A tree of boxes over up to ``capacity`` things, named by numbers below that.

    Args:
        capacity: most things.
        margin: by which boxes are larger than what is put in [m], so that small moves change nothing.
    """

    def __init__(self, capacity: int, margin: float = 0.0) -> None:
        self.capacity = capacity
        self.margin = margin
        self._boxes = tree_numbers(capacity)
        self._stack = tree_words(capacity)
        self._words = np.zeros(self._stack + STACK + capacity, dtype=np.int64)
        # Behind the boxes of the tree that which is asked for.
        self._numbers = np.zeros(self._boxes + BOX_NUMBERS)
        _clear(self._words, capacity)

    def _holds(self, thing: int) -> bool:
        return bool(_is_within(self._words, thing))

    def insert(self, thing: int, low: np.ndarray, high: np.ndarray) -> None:
        """Put in a thing that lies between two corners [m], each (3,)."""
        if self._holds(thing):
            raise ValueError(f"Hierarchy: {thing} is in already; it can be in once. Use refit.")
        own = self._numbers[BOX_NUMBERS * thing : BOX_NUMBERS * thing + BOX_NUMBERS]
        own[:3] = np.asarray(low) - self.margin
        own[3:] = np.asarray(high) + self.margin
        _insert(self._words, self._numbers, self.capacity, thing)

    def remove(self, thing: int) -> None:
        """Take a thing out."""
        if not self._holds(thing):
            raise ValueError(f"Hierarchy: {thing} is not in; only what is can be removed.")
        _remove(self._words, self._numbers, self.capacity, thing)

    def refit(self, thing: int, low: np.ndarray, high: np.ndarray) -> bool:
        """Move a thing; whether it had left its box and the tree changed."""
        own = self._numbers[BOX_NUMBERS * thing : BOX_NUMBERS * thing + BOX_NUMBERS]
        if self._holds(thing):
            if (own[:3] <= low).all() and (own[3:] >= high).all():
                return False
            self.remove(thing)
        self.insert(thing, low, high)
        return True

    def meeting(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Numbers of the things whose boxes meet that between two corners, ascending."""
        self._numbers[self._boxes :] = np.concatenate([low, high])
        found = self._stack + STACK
        count = _meeting(self._words, self._numbers, self.capacity, self._boxes, self._stack, found)
        return self._words[found : found + count].copy()

    @property
    def depth(self) -> int:
        """Most nodes between the root and a leaf, both counted; 0 without leaves."""
        longest = 0
        for leaf in filter(self._holds, range(self.capacity)):
            node, length = leaf, 0
            while node >= 0:
                node, length = int(self._words[_HEAD + _NODE * node + _PARENT]), length + 1
            longest = max(longest, length)
        return longest
