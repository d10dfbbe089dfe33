"""A tree of boxes over things: what meets a box or lies on a path is found without trying all.

Leaves are the things; every other node is the box about two more. A thing goes in beside the node that this enlarges
least; on the way back up, a child changes places with a grandchild where that makes boxes smaller, which keeps the tree
even. Moving a thing takes it out and puts it in again only where it has left its box.

Source: Catto (2019), *Dynamic Bounding Volume Hierarchies*; Goldsmith & Salmon (1987) for the cost.
"""

from __future__ import annotations

import numpy as np

from ..kernel import inner, kernel

_PARENT, _LEFT, _RIGHT = range(3)
#: Words of the head: root, first free inner node.
ROOT, FREE, HEAD = range(3)
#: Nodes that a walk may have before it: more than any tree of rotations is deep, which no walk checks.
STACK = 256


@inner
def _area(bounds, i):
    """Half the surface of a box."""
    x = bounds[i, 3] - bounds[i, 0]
    y = bounds[i, 4] - bounds[i, 1]
    z = bounds[i, 5] - bounds[i, 2]
    return x * y + y * z + z * x


@inner
def _joint_area(bounds, i, j):
    """Half the surface of the box about two."""
    x = max(bounds[i, 3], bounds[j, 3]) - min(bounds[i, 0], bounds[j, 0])
    y = max(bounds[i, 4], bounds[j, 4]) - min(bounds[i, 1], bounds[j, 1])
    z = max(bounds[i, 5], bounds[j, 5]) - min(bounds[i, 2], bounds[j, 2])
    return x * y + y * z + z * x


@inner
def _join(nodes, bounds, i):
    """Make a node's box that about its children."""
    left = nodes[i, _LEFT]
    right = nodes[i, _RIGHT]
    for k in range(3):
        bounds[i, k] = min(bounds[left, k], bounds[right, k])
        bounds[i, 3 + k] = max(bounds[left, 3 + k], bounds[right, 3 + k])


@inner
def _swap(nodes, node, side, child, child_side):
    """Let a child of a node and a child of its other child change places."""
    one = nodes[node, side]
    two = nodes[child, child_side]
    nodes[node, side] = two
    nodes[two, _PARENT] = node
    nodes[child, child_side] = one
    nodes[one, _PARENT] = child


@inner
def _rotate(nodes, bounds, leaves, node):
    """The exchange of a child with a grandchild that makes the other child smallest, if any does."""
    best = 0.0
    best_side = -1
    best_child = -1
    best_child_side = -1
    for side in range(_LEFT, _RIGHT + 1):
        child = nodes[node, _LEFT + _RIGHT - side]
        if child >= leaves:
            area = _area(bounds, child)
            for child_side in range(_LEFT, _RIGHT + 1):
                # What stays below the child is its other one, beside the node's.
                stays = nodes[child, _LEFT + _RIGHT - child_side]
                gain = area - _joint_area(bounds, nodes[node, side], stays)
                if gain > best:
                    best = gain
                    best_side = side
                    best_child = child
                    best_child_side = child_side
    if best_side >= 0:
        _swap(nodes, node, best_side, best_child, best_child_side)
        _join(nodes, bounds, best_child)


@inner
def _mend(nodes, bounds, leaves, node):
    """Boxes and balance from a node up to the root."""
    while node >= 0:
        _join(nodes, bounds, node)
        _rotate(nodes, bounds, leaves, node)
        node = nodes[node, _PARENT]


@inner
def _sibling(nodes, bounds, leaves, root, leaf):
    """The node beside which a leaf enlarges the tree least, going down greedily."""
    node = root
    while node >= leaves:
        joint = _joint_area(bounds, node, leaf)
        # Beside this node; or below, where it grows with all that is above.
        here = joint
        inherited = joint - _area(bounds, node)
        best = 1e300
        best_child = -1
        for side in range(_LEFT, _RIGHT + 1):
            child = nodes[node, side]
            cost = _joint_area(bounds, child, leaf) + inherited
            if child >= leaves:
                cost -= _area(bounds, child)
            if cost < best:
                best = cost
                best_child = child
        if here <= best:
            break
        node = best_child
    return node


@inner
def clear_tree(nodes, head, leaves):
    """A tree without leaves."""
    head[ROOT] = -1
    head[FREE] = leaves if leaves > 1 else -1
    for i in range(leaves, 2 * leaves - 1):
        nodes[i, _PARENT] = i + 1 if i + 1 < 2 * leaves - 1 else -1
    for i in range(leaves):
        nodes[i, _PARENT] = -1


@inner
def insert_leaf(nodes, bounds, head, leaves, leaf):
    """Put a leaf into the tree, whose box is written."""
    root = head[ROOT]
    if root < 0:
        head[ROOT] = leaf
        nodes[leaf, _PARENT] = -1
        return
    beside = _sibling(nodes, bounds, leaves, root, leaf)
    above = nodes[beside, _PARENT]
    node = head[FREE]
    head[FREE] = nodes[node, _PARENT]
    nodes[node, _PARENT] = above
    nodes[node, _LEFT] = beside
    nodes[node, _RIGHT] = leaf
    nodes[beside, _PARENT] = node
    nodes[leaf, _PARENT] = node
    if above < 0:
        head[ROOT] = node
    elif nodes[above, _LEFT] == beside:
        nodes[above, _LEFT] = node
    else:
        nodes[above, _RIGHT] = node
    _mend(nodes, bounds, leaves, node)


@inner
def remove_leaf(nodes, bounds, head, leaves, leaf):
    """Take a leaf out of the tree."""
    node = nodes[leaf, _PARENT]
    nodes[leaf, _PARENT] = -1
    if node < 0:
        head[ROOT] = -1
        return
    other = nodes[node, _LEFT] + nodes[node, _RIGHT] - leaf
    above = nodes[node, _PARENT]
    nodes[other, _PARENT] = above
    if above < 0:
        head[ROOT] = other
    elif nodes[above, _LEFT] == node:
        nodes[above, _LEFT] = other
    else:
        nodes[above, _RIGHT] = other
    nodes[node, _PARENT] = head[FREE]
    head[FREE] = node
    _mend(nodes, bounds, leaves, above)


@inner
def children(nodes, node):
    """Both children of a node that is no leaf."""
    return nodes[node, _LEFT], nodes[node, _RIGHT]


@inner
def meets(bounds, i, box):
    """Whether a node's box meets another, in a row of six numbers."""
    return (
        bounds[i, 0] <= box[3]
        and box[0] <= bounds[i, 3]
        and bounds[i, 1] <= box[4]
        and box[1] <= bounds[i, 4]
        and bounds[i, 2] <= box[5]
        and box[2] <= bounds[i, 5]
    )


@kernel
def _clear(nodes, head, leaves):
    clear_tree(nodes, head, leaves)


@kernel
def _insert(nodes, bounds, head, leaves, leaf):
    insert_leaf(nodes, bounds, head, leaves, leaf)


@kernel
def _remove(nodes, bounds, head, leaves, leaf):
    remove_leaf(nodes, bounds, head, leaves, leaf)


@kernel
def _meeting(nodes, bounds, head, leaves, box, stack, found):
    """Leaves whose boxes meet a box into ``found``; how many."""
    count = 0
    if head[ROOT] < 0:
        return count
    stack[0] = head[ROOT]
    waiting = 1
    while waiting > 0:
        waiting -= 1
        node = stack[waiting]
        if meets(bounds, node, box):
            if node < leaves:
                found[count] = node
                count += 1
            else:
                left, right = children(nodes, node)
                stack[waiting] = left
                stack[waiting + 1] = right
                waiting += 2
    return count


class Hierarchy:
    """A tree of boxes over up to ``capacity`` things, named by numbers below that.

    Args:
        capacity: most things.
        margin: by which boxes are larger than what is put in [m], so that small moves change nothing.
    """

    def __init__(self, capacity: int, margin: float = 0.0) -> None:
        self.capacity = capacity
        self.margin = margin
        self._nodes = np.full((max(2 * capacity - 1, 1), 3), -1, dtype=np.int64)
        self._bounds = np.zeros((max(2 * capacity - 1, 1), 6))
        self._head = np.zeros(HEAD, dtype=np.int64)
        self._within = np.zeros(capacity, dtype=bool)
        _clear(self._nodes, self._head, capacity)

    def insert(self, thing: int, low: np.ndarray, high: np.ndarray) -> None:
        """Put in a thing that lies between two corners [m], each (3,)."""
        if self._within[thing]:
            raise ValueError(f"Hierarchy: {thing} is in already; it can be in once. Use refit.")
        self._bounds[thing, :3] = np.asarray(low) - self.margin
        self._bounds[thing, 3:] = np.asarray(high) + self.margin
        self._within[thing] = True
        _insert(self._nodes, self._bounds, self._head, self.capacity, thing)

    def remove(self, thing: int) -> None:
        """Take a thing out."""
        if not self._within[thing]:
            raise ValueError(f"Hierarchy: {thing} is not in; only what is can be removed.")
        self._within[thing] = False
        _remove(self._nodes, self._bounds, self._head, self.capacity, thing)

    def refit(self, thing: int, low: np.ndarray, high: np.ndarray) -> bool:
        """Move a thing; whether it had left its box and the tree changed."""
        own = self._bounds[thing]
        if self._within[thing] and (own[:3] <= low).all() and (own[3:] >= high).all():
            return False
        if self._within[thing]:
            self.remove(thing)
        self.insert(thing, low, high)
        return True

    def meeting(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Numbers of the things whose boxes meet that between two corners, ascending."""
        box = np.concatenate([low, high]).astype(np.float64)
        found = np.empty(self.capacity, dtype=np.int64)
        stack = np.empty(STACK, dtype=np.int64)
        count = _meeting(self._nodes, self._bounds, self._head, self.capacity, box, stack, found)
        return np.sort(found[:count])

    @property
    def depth(self) -> int:
        """Most nodes between the root and a leaf, both counted; 0 without leaves."""
        longest = 0
        for leaf in np.flatnonzero(self._within):
            node, length = int(leaf), 0
            while node >= 0:
                node, length = int(self._nodes[node, _PARENT]), length + 1
            longest = max(longest, length)
        return longest
