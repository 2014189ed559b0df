"""Imagining the clutter: a further start is tried in environments that agree with what was felt.

Beyond the paper: its LIC-2 knows of a failed reach where it began and ended. The skin felt more:
where objects are, which of them yield, and where there is nothing. Environments are drawn that
agree with that, and the starts that seem best are simulated in them, fewer and fewer in more.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import count, islice

import numpy as np

from lic_drake.clutter.instance import ClutterInstance
from lic_drake.control.taxels import make_taxels
from lic_drake.errors import RequestError
from lic_drake.reach.environment import Environment
from lic_drake.reach.request import ReachRequest
from lic_drake.reach.session import default_session
from lic_drake.reach.start import Start, Starts
from lic_drake.select.felt import OVERLAP_M, Felt, feel
from lic_drake.select.lic import LicSelector
from lic_drake.select.situation import Selection, Situation
from lic_drake.types import BoolVector, Vector

STREAM = "imagination"
"""Seed stream of the environments."""

ROUNDS = ((12, 1), (6, 2), (3, 4))
"""How many starts are tried in how many further environments, round by round."""

WORTH = 2.0
"""The estimate counts as so many imagined reaches."""

FAR_M = 50.0
"""Distance from W at which objects without room are, metres."""

_FURTHER_DRAWS = 10


class ImaginingSelector:
    """LIC for the first attempt; for further ones the best of its starts in imagined environments.

    It needs the requests of the failed reaches, and clutter of loose cylinders or spheres of one
    size; what is fixed around them, as a board, has to be known.
    """

    def __init__(
        self, lic: LicSelector, method: str = "imagine", say: Callable[[str], None] = print
    ) -> None:
        """Sets up a selector; LIC-2's choice, if there is one, is among what is tried.

        `say` receives a line before every choice that takes long.
        """
        self._lic, self._elsewhere = lic, LicSelector(lic.first)
        self.method, self._say = method, say

    def select(self, situation: Situation) -> Selection:
        """Returns the start that reached the goal most often.

        Raises:
            RequestError: What a failed reach felt, or the kind of clutter, does not allow it.
        """
        began = time.perf_counter()
        if not situation.failed:
            return replace(self._lic.select(situation), method=self.method)
        requests = requests_of(situation)
        trials = sum(keep * further for keep, further in ROUNDS)
        self._say(f"imagining the clutter from what was felt: {trials} reaches ...")
        starts, estimates = self._candidates(situation)
        scenario, diagrams = requests[-1].scenario, default_session(True).diagrams

        def world(instance: ClutterInstance) -> Callable[..., Environment]:
            """Returns the environment as bases find it."""
            return cache(lambda *b0: Environment(scenario, instance, True, np.array(b0), diagrams))

        def reaches(world: Callable[..., Environment], k: int) -> bool:
            start = starts[k]
            result = world(*start.b0.tolist()).reach(situation.p_WG, start.x0, q=start.q)
            return result.outcome == "reached"

        best, share = race(estimates, map(world, imagined_environments(requests)), reaches)
        return Selection(starts[best], share, self.method, time.perf_counter() - began)

    def _candidates(self, situation: Situation) -> tuple[list[Start], Vector]:
        """Returns starts, LIC's choices and the best discrete ones, and LIC-1's estimates."""
        chosen = [selector.select(situation).start for selector in (self._lic, self._elsewhere)]
        before, grid = replace(situation, failed=()), situation.starts.grid
        estimates = self._lic.program(before).estimates
        allowed = np.flatnonzero(situation.allowed(grid))
        best = allowed[np.argsort(-estimates(grid)[allowed], kind="stable")]
        starts = [*chosen, *(grid[int(k)] for k in best[: ROUNDS[0][0] - len(chosen)])]
        return starts, np.concatenate([estimates(Starts.of(start)) for start in starts])


def requests_of(situation: Situation) -> list[ReachRequest]:
    """Returns the requests of the failed reaches; a RequestError where one is not known."""
    requests = [reach.request for reach in situation.failed if reach.request is not None]
    if len(requests) < len(situation.failed):
        raise RequestError(
            "imagining needs to know what the failed reaches felt, and of these only where they"
            " began and ended is known; choose gp or knn"
        )
    return requests


def imagined_environments(requests: Sequence[ReachRequest]) -> Iterator[ClutterInstance]:
    """Yields environments that agree with what failed reaches felt, without end.

    Raises:
        RequestError: They are of clutter that cannot be imagined.
    """
    scenario = requests[-1].scenario
    known = scenario.sample_instance(requests[-1].stream, requests[-1].environment)
    loose = np.array([shape != "box" for shape in known.shape])
    radii = np.unique(known.size[loose, 0])
    if len(radii) != 1 or known.stems is not None or (known.p_WA is None and not np.all(loose)):
        raise RequestError(
            f"imagining is for loose cylinders or spheres of one size, not for {scenario.category};"
            " choose gp or knn"
        )
    traces = [default_session(True).simulate(request).trace for request in requests]
    arm = scenario.arm()
    layout = make_taxels(arm, scenario.scene.taxels_per_m)
    felt = feel([trace for trace in traces if trace.q], arm, layout, float(radii[0]), known)
    first = int(requests[-1].key, 16) % 2**31
    draws = (scenario.sample_instance(STREAM, index).p_WO for index in count(first))
    while True:
        p_WO = imagine(draws, loose, known.movable, float(radii[0]), felt)
        # Of the environment itself only what is fixed around the objects is known.
        yield replace(known, p_WO=np.where(loose[:, np.newaxis], p_WO, known.p_WO))


def imagine(
    draws: Iterator[Vector], loose: BoolVector, movable: BoolVector, radius: float, felt: Felt
) -> Vector:
    """Returns positions p_WO of n objects, shape (n, 3), metres, that agree with what was felt.

    Objects are put where some were felt, the nearest ones of a kind. For those in the way of the
    arm or of each other there may be room where further draws have some; else they are left out,
    far away.

    Args:
        draws: Positions of the category, each shape (n, 3).
        loose: Which objects are of one radius and unknown, shape (n,).
        movable: Which of them yield, shape (n,).
        radius: In metres.
        felt: What the reaches felt.
    """
    p_WO = next(draws).copy()
    d = felt.still.shape[1]
    placed = np.zeros(len(p_WO), dtype=bool)
    fixed = loose & ~movable
    # Where all can yield, one that did not is jammed.
    for centres, kind in (
        (felt.still, fixed if np.any(fixed) else loose),
        (felt.pushed, loose & movable),
    ):
        for centre in centres:
            free = np.flatnonzero(kind & ~placed)
            if not len(free):
                break
            nearest = free[np.argmin(np.linalg.norm(p_WO[free, :d] - centre, axis=1))]
            p_WO[nearest, :d], placed[nearest] = centre, True

    def has_room(points: Vector) -> BoolVector:
        apart = np.linalg.norm(points[:, np.newaxis, :d] - p_WO[placed, :d], axis=2)
        apart_enough = apart.min(axis=1, initial=np.inf) >= 2.0 * radius
        return np.asarray(apart_enough & (felt.gaps(points[:, :d]) >= radius - OVERLAP_M))

    for i in np.flatnonzero(loose & ~placed):
        placed[i] = has_room(p_WO[[i]])[0]
    for again in islice(draws, _FURTHER_DRAWS):
        for i in np.flatnonzero(loose & ~placed):
            others = again[loose & (movable == movable[i])]
            if np.any(room := has_room(others)):
                p_WO[i], placed[i] = others[np.argmax(room)], True
        if np.all(placed[loose]):
            break
    out = np.flatnonzero(loose & ~placed)
    p_WO[out, 0] = FAR_M + 2.0 * radius * np.arange(len(out))
    return p_WO


def race[T](
    estimates: Vector, environments: Iterable[T], reaches: Callable[[T, int], bool]
) -> tuple[int, float]:
    """Returns the best of n alternatives and its share of successes, by successive halving.

    Args:
        estimates: What is believed of each before, shape (n,).
        environments: As many as `ROUNDS` ask for.
        reaches: Whether an alternative succeeds in an environment.
    """
    won, tried, remaining = np.zeros(len(estimates)), np.zeros(len(estimates)), iter(environments)
    share = estimates
    for keep, further in ROUNDS:
        kept = np.argsort(-share, kind="stable")[:keep]
        for environment in islice(remaining, further):
            won[kept] += [reaches(environment, int(k)) for k in kept]
        tried[kept] += further
        share = np.full(len(estimates), -np.inf)
        share[kept] = ((won + WORTH * estimates) / (tried + WORTH))[kept]
    best = int(np.argmax(share))
    return best, float(share[best])
