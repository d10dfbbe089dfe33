"""``World.queries``: casts, overlaps and lines of sight, for many questions in all worlds at once."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..collision.hierarchy import STACK, tree_numbers, tree_words
from ..model.colliders import CENTRE, PLACED, SIZE, SPHERE, TURN, kind_and_size
from ..scene import checks
from ..scene.shapes import Box, Capsule, Hollow, Shape, Sphere, rotation_matrix
from .casts import HIT, MANY, MEMORY, cast_many, overlap_many
from .placed import colliders_in, owners_in, placed_colliders

if TYPE_CHECKING:
    from ..world import World

_UPRIGHT = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Hits:
    """What was hit, by worlds, questions and, where all hits were asked for, hits in the order of their distance.

    Attributes:
        things: bodies, particles and grounds that can be hit.
        thing: which of them was, as an index, or -1; (worlds, questions) or (worlds, questions, hits) int64.
        distance: way to the hit [m]; inf without one.
        gap: 0, or below 0 by how deep [m] the shape lay in the thing at its start.
        normal: unit vector out of what was hit, (..., 3).
        place: where [m], (..., 3).
    """

    things: tuple[Any, ...]
    thing: np.ndarray
    distance: np.ndarray
    gap: np.ndarray
    normal: np.ndarray
    place: np.ndarray

    @property
    def hit(self) -> np.ndarray:
        """Whether anything was."""
        return self.thing >= 0

    def of(self, thing: Any) -> np.ndarray:
        """Where a thing was hit, bool of the shape of ``thing``."""
        index = next((k for k, other in enumerate(self.things) if other is thing), None)
        if index is None:
            raise KeyError("Hits: this thing has no shape in the world's scene; add it.")
        return np.asarray(self.thing == index)


class Queries:
    """Questions about where things are now. None of them changes the world.

    Places and directions are of shape (3,), (questions, 3) or (worlds, questions, 3); what is asked in one shape of all
    worlds is asked in each. ``only`` and ``ignore`` name bodies, particles and grounds that can, or cannot, be hit.
    """

    __slots__ = ("_world",)
    #: Shapes from which on a tree of boxes is planted over them, and not all are tried.
    many: ClassVar[int] = MANY

    def __init__(self, world: World) -> None:
        self._world = world

    def ray(
        self, start: Any, direction: Any, *, reach: Any = np.inf, every: bool = False,
        only: Iterable[Any] | None = None, ignore: Iterable[Any] = (),
    ) -> Hits:  # fmt: skip
        """Where rays hit.

        Args:
            start: [m].
            direction: of any length but 0.
            reach: longest way [m], above 0; a number or (questions,).
            every: all hits, nearest first, and not the first alone.
            only: what can be hit.
            ignore: what cannot.

        Raises:
            ValueError: not finite, of another shape, or without a direction.
        """
        return self._cast(
            SPHERE, (0.0, 0.0, 0.0), start, direction, _UPRIGHT, reach, every, only, ignore
        )

    def segment(
        self, start: Any, end: Any, *, every: bool = False,
        only: Iterable[Any] | None = None, ignore: Iterable[Any] = (),
    ) -> Hits:  # fmt: skip
        """Where segments from start to end [m] hit; see ``ray``."""
        way = self._points("end", end) - self._points("start", start)
        length = np.linalg.norm(way, axis=-1)
        return self.ray(start, way, reach=length, every=every, only=only, ignore=ignore)

    def cast(
        self, shape: Shape, start: Any, direction: Any, *, orientation: Any = _UPRIGHT, reach: Any = np.inf,
        every: bool = False, only: Iterable[Any] | None = None, ignore: Iterable[Any] = (),
    ) -> Hits:  # fmt: skip
        """Where a shape that moves along a line first touches.

        Args:
            shape: a Sphere, Box or Capsule.
            start: of its centre [m].
            direction: of any length but 0.
            orientation: quaternion (w, x, y, z) of the shape, of any length but 0; as places in shape.
            reach: longest way [m].
            every: all hits, nearest first; those that the shape overlaps at its start have distance 0.
            only: what can be hit.
            ignore: what cannot.
        """
        kind, size = self._shape(shape)
        return self._cast(kind, size, start, direction, orientation, reach, every, only, ignore)

    def overlap(
        self, shape: Shape, place: Any, *, orientation: Any = _UPRIGHT,
        only: Iterable[Any] | None = None, ignore: Iterable[Any] = (),
    ) -> Hits:  # fmt: skip
        """Everything that a shape overlaps, deepest first: "all within a radius" with a Sphere. See ``cast``."""
        kind, size = self._shape(shape)
        query = self._query(kind, size, place, orientation)
        return self._sorted(query, None, kind, np.zeros(query.shape[:2]), True, only, ignore)

    def sees(
        self, start: Any, end: Any, *, only: Iterable[Any] | None = None, ignore: Iterable[Any] = ()
    ) -> np.ndarray:
        """Whether nothing lies between places, (worlds, questions) bool: the line of sight."""
        return ~self.segment(start, end, only=only, ignore=ignore).hit

    # Inside

    def _shape(self, shape: Any) -> tuple[int, tuple[float, float, float]]:
        if isinstance(shape, Hollow) or not isinstance(shape, Sphere | Box | Capsule):
            raise TypeError(
                f"World.queries: shape is {shape!r}; it must be a Sphere, Box or Capsule. Use Sphere(0.5)."
            )
        return kind_and_size(shape)

    def _points(self, name: str, value: Any, width: int = 3) -> np.ndarray:
        """Finite vectors in shape (worlds, questions, width), or with 1 for all worlds."""
        given = checks.floats(value)
        worlds = self._world.worlds
        good = given is not None and 1 <= given.ndim <= 3 and given.shape[-1] == width
        if given is None or not good or (given.ndim == 3 and given.shape[0] not in (1, worlds)):
            raise ValueError(
                f"World.queries: {name} is {checks.described(value)}; it must be of shape ({width},), "
                f"(questions, {width}) or ({worlds}, questions, {width}). Give one vector for each question."
            )
        if not np.isfinite(given).all():
            raise ValueError(
                f"World.queries: {name} is not finite in every place; it must be. Give metres."
            )
        return given.reshape((1,) * (3 - given.ndim) + given.shape)

    def _query(
        self, kind: int, size: tuple[float, float, float], place: Any, orientation: Any
    ) -> np.ndarray:
        """The shape placed for every question."""
        centre = self._points("start", place)
        turn = self._points("orientation", orientation, 4)
        length = np.linalg.norm(turn, axis=-1, keepdims=True)
        if not (length > 0.0).all():
            raise ValueError(
                "World.queries: orientation is 0; it must be a quaternion. Use (1, 0, 0, 0)."
            )
        turn = rotation_matrix(turn / length)
        shape = np.broadcast_shapes(centre.shape[:2], turn.shape[:2], (self._world.worlds, 1))
        query = np.zeros((*shape, PLACED))
        query[..., CENTRE : CENTRE + 3] = centre
        query[..., TURN : TURN + 9] = turn.reshape(*turn.shape[:2], 9)
        query[..., SIZE : SIZE + 3] = size
        return query

    def _cast(
        self, kind: int, size: Any, start: Any, direction: Any, orientation: Any, reach: Any, every: bool, only: Any,
        ignore: Any,
    ) -> Hits:  # fmt: skip
        query = self._query(kind, size, start, orientation)
        way = self._points("direction", direction)
        length = np.linalg.norm(way, axis=-1, keepdims=True)
        if not (length > 0.0).all():
            raise ValueError(
                "World.queries: direction is 0; it must point somewhere. Give any other vector."
            )
        far = checks.floats(reach)
        if far is None or not (far > 0.0).all():
            raise ValueError(
                f"World.queries: reach is {reach!r}; it must be greater than 0. Leave it out for inf."
            )
        shape = np.broadcast_shapes(query.shape[:2], way.shape[:2], far.shape)
        query = np.ascontiguousarray(np.broadcast_to(query, (*shape, PLACED)))
        way = np.ascontiguousarray(np.broadcast_to(way / length, (*shape, 3)))
        # Infinite ways would be 0 times infinity where a ray lies in the side of a box.
        far = np.ascontiguousarray(np.broadcast_to(np.minimum(far, 1e200), shape))
        return self._sorted(query, way, kind, far, every, only, ignore)

    def _sorted(
        self,
        query: np.ndarray,
        way: np.ndarray | None,
        kind: int,
        reach: np.ndarray,
        every: bool,
        only: Any,
        ignore: Any,
    ) -> Hits:
        """Ask, and put hits in order; ``way`` None asks for overlaps."""
        colliders = colliders_in(self._world)
        n = len(colliders)
        allowed = self._allowed(colliders, only, ignore)
        shape = (*query.shape[:2], max(n, 1) if every else 1)
        found = np.full(shape, -1, dtype=np.int64)
        hits = np.zeros((*shape, HIT))
        work = (
            np.zeros(MEMORY), np.zeros(tree_words(n), dtype=np.int64), np.zeros(tree_numbers(n) + 6),
            np.zeros(STACK, dtype=np.int64),
        )  # fmt: skip
        placed = placed_colliders(self._world)
        if way is None:
            overlap_many(
                colliders.kind, placed, allowed, kind, query, n >= self.many, found, hits, *work
            )
        else:
            cast_many(
                colliders.kind,
                placed,
                allowed,
                kind,
                query,
                way,
                reach,
                every,
                n >= self.many,
                found,
                hits,
                *work,
                np.zeros(9 + HIT),
            )
        distance = np.where(found >= 0, hits[..., 0], np.inf)
        if every:
            # By distance, then by depth, then as the scene has them.
            order = np.lexsort((np.where(found >= 0, hits[..., 1], np.inf), distance), axis=-1)
            most = max(int((found >= 0).sum(axis=-1).max(initial=0)), 1)
            order = order[..., :most]
            found = np.take_along_axis(found, order, -1)
            distance = np.take_along_axis(distance, order, -1)
            hits = np.take_along_axis(hits, order[..., None], -2)
        else:
            found, distance, hits = found[..., 0], distance[..., 0], hits[..., 0, :]
        things, index = owners_in(self._world)
        return Hits(
            things=things,
            thing=np.where(found >= 0, index[found], -1) if n else found,
            distance=distance,
            gap=hits[..., 1],
            normal=hits[..., 2:5],
            place=hits[..., 5:8],
        )

    def _allowed(self, colliders: Any, only: Any, ignore: Any) -> np.ndarray:
        """Which colliders can be hit."""
        known = {id(owner) for owner in colliders.owner}
        for name, things in (("only", only or ()), ("ignore", ignore)):
            for thing in things:
                if id(thing) not in known:
                    raise KeyError(
                        f"World.queries: {name} has a {type(thing).__name__} without a shape in the "
                        "world's scene; add it."
                    )
        wanted = known if only is None else {id(thing) for thing in only}
        wanted -= {id(thing) for thing in ignore}
        return np.array([id(owner) in wanted for owner in colliders.owner], dtype=bool)
