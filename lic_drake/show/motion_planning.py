"""Paths of a robot's joints past what it knows of: RRT-Connect (Kuffner and LaValle, 2000)."""

from collections.abc import Callable

import numpy as np

from lic_drake.types import Vector

STEP_RAD = 0.25
"""How far a tree grows at a time."""

CHECKED_RAD = 0.03
"""Configurations along a path are checked so far apart."""

MAX_NODES = 4000
"""A search that has grown so much gives up."""

SHORTCUTS = 60
"""So many times two places of a path are connected directly, if they can be."""


def plan_motion(
    is_free: Callable[[Vector], bool],
    q_min: Vector,
    q_max: Vector,
    q_from: Vector,
    q_to: Vector,
    rng: np.random.Generator,
) -> Vector | None:
    """Returns a path of straight lines, shape (k, m), radians, or None if none was found.

    Args:
        is_free: Whether the robot touches nothing in a configuration, shape (m,).
        q_min: Lower joint limits, shape (m,), radians.
        q_max: Upper joint limits, shape (m,), radians.
        q_from: Where it begins, shape (m,), radians.
        q_to: Where it ends, shape (m,), radians.
        rng: Draws where trees grow.
    """
    if is_path_free(is_free, q_from, q_to):
        return np.array([q_from, q_to])
    growing, other = _Tree(q_from), _Tree(q_to)
    while len(growing) + len(other) < MAX_NODES:
        new = growing.grow(is_free, rng.uniform(q_min, q_max))
        if new is not None:
            met = other.grow_until(is_free, growing.q[new])
            if met is not None:
                there, back = growing.path(new), other.path(met)
                path = [*there[::-1], *back[1:]]
                if not np.array_equal(path[0], q_from):
                    path.reverse()
                return _shortened(is_free, path, rng)
        growing, other = other, growing
    return None


def is_path_free(is_free: Callable[[Vector], bool], q_from: Vector, q_to: Vector) -> bool:
    """Tells whether a straight line, its beginning not counted, is free."""
    steps = max(1, int(np.ceil(np.abs(q_to - q_from).max() / CHECKED_RAD)))
    return all(is_free(q_from + (k / steps) * (q_to - q_from)) for k in range(1, steps + 1))


class _Tree:
    """Configurations that can be reached from a root, each from its parent on a straight line."""

    def __init__(self, root: Vector) -> None:
        self.q = [root]
        self._parent = [0]

    def __len__(self) -> int:
        return len(self.q)

    def grow(self, is_free: Callable[[Vector], bool], towards: Vector) -> int | None:
        """Makes one step towards a configuration; returns its index, None if it is not free."""
        nearest = int(np.argmin(np.linalg.norm(np.array(self.q) - towards, axis=1)))
        return self._step(is_free, nearest, towards)

    def grow_until(self, is_free: Callable[[Vector], bool], goal: Vector) -> int | None:
        """Makes steps until the goal is there; returns its index, None if something is between."""
        at: int | None = int(np.argmin(np.linalg.norm(np.array(self.q) - goal, axis=1)))
        while at is not None and not np.array_equal(self.q[at], goal):
            at = self._step(is_free, at, goal)
        return at

    def path(self, index: int) -> list[Vector]:
        """Returns the configurations from one back to the root."""
        path = [self.q[index]]
        while index:
            index = self._parent[index]
            path.append(self.q[index])
        return path

    def _step(self, is_free: Callable[[Vector], bool], index: int, towards: Vector) -> int | None:
        d = towards - self.q[index]
        distance = float(np.linalg.norm(d))
        q = towards if distance <= STEP_RAD else self.q[index] + (STEP_RAD / distance) * d
        if not is_path_free(is_free, self.q[index], q):
            return None
        self.q.append(q)
        self._parent.append(index)
        return len(self.q) - 1


def _shortened(
    is_free: Callable[[Vector], bool], path: list[Vector], rng: np.random.Generator
) -> Vector:
    """Returns a path without some of its detours."""
    for _ in range(SHORTCUTS):
        if len(path) < 3:
            break
        i, k = sorted(rng.choice(len(path), size=2, replace=False))
        if k > i + 1 and is_path_free(is_free, path[i], path[k]):
            del path[i + 1 : k]
    return np.array(path)
