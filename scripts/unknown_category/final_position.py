"""Where a reach that fails ends: a conditional density, to tell categories of clutter apart."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist
from scipy.special import logsumexp

from lic_drake.errors import EstimateError
from lic_drake.estimate.features import FeatureMap
from lic_drake.estimate.rows import feature_scale, selection_folds
from lic_drake.seeds import make_generator
from lic_drake.types import Vector

OUTLIERS = 0.05
"""Share of failures that end anywhere, in the square metre in front of the robot: no single
observation can then rule out a category."""

# Widths of the kernels: of features in their standard deviations, of final positions in metres.
_NEARNESS = (0.15, 0.3, 0.6, 1.2)
_WIDTHS_M = (0.02, 0.04, 0.08, 0.16)
_MAX_TRIED = 200


@dataclass(frozen=True, kw_only=True)
class FinalPositions:
    """p(x_inf | failure, z) in the plane from the failures of a library.

    A kernel estimate of the conditional density (Rosenblatt 1969): Gaussians around the final
    positions of past failures, each with the weight that its features are near to z. Both widths
    are those that best predict environments that were held out, by their likelihood.

    Attributes:
        Z: Features of LIC-1 of the failures, divided by the kernel's widths, shape (n, d).
        scale: These widths, shape (d,).
        p_RE: Where they ended, in the robot's frame, shape (n, 2), metres.
        width_m: Standard deviation of the Gaussians around them, metres.
    """

    Z: Vector
    scale: Vector
    p_RE: Vector
    width_m: float

    @classmethod
    def fit(cls, features: FeatureMap, columns: Mapping[str, NDArray[Any]]) -> Self:
        """Learns from the columns of a library D1 in the plane.

        Args:
            features: Of LIC-1.
            columns: Of the library.

        Raises:
            EstimateError: A column is missing, or the library has no failure that ended anywhere.
        """
        rows = features.rows(columns)
        p_WE = np.column_stack([columns["final_x"], columns["final_y"]]).astype(float)
        zeros = np.zeros(len(p_WE))
        base = np.column_stack([columns.get("base_x", zeros), columns.get("base_y", zeros)])
        failed = (rows.y == 0.0) & np.isfinite(p_WE).all(axis=1)
        if not failed.any():
            raise EstimateError(
                "the library has no failed reach with a final position, from which to learn where"
                " failures end; use the mixture without final positions"
            )
        Z, p_RE = rows.X[failed], (p_WE - base)[failed]
        scale = feature_scale(Z)
        fold = selection_folds(rows.groups[failed], len(Z))
        candidates = [
            cls(Z=Z / (nearness * scale), scale=nearness * scale, p_RE=p_RE, width_m=width_m)
            for nearness in _NEARNESS
            for width_m in _WIDTHS_M
        ]
        if fold.max() == 0:  # Nothing can be held out.
            return candidates[-1]
        rng = make_generator("training", "failures for the widths of final positions")
        tried = rng.permutation(len(Z))[:_MAX_TRIED]
        seen = fold[tried][:, None] != fold
        return max(candidates, key=lambda c: c._log_density(c.Z[tried], p_RE[tried], seen).sum())

    def log_density(self, z: ArrayLike, p_RE: ArrayLike) -> Vector:
        """Returns log p(x_inf | failure, z) at m positions, shape (m,), of a density in 1/m^2.

        Args:
            z: Features of LIC-1 of the failed reach, shape (d,).
            p_RE: Positions in the robot's frame, shape (m, 2), metres.
        """
        query = np.atleast_2d(np.asarray(z, dtype=float)) / self.scale
        return self._log_density(query, np.asarray(p_RE, dtype=float))

    def _log_density(
        self, queries: Vector, p_RE: Vector, seen: NDArray[np.bool_] | None = None
    ) -> Vector:
        """Returns the logarithms for m queries in widths, or one for all m positions.

        Args:
            queries: Shape (m, d) or (1, d).
            p_RE: Shape (m, 2).
            seen: What each query may learn from, shape (m, n); by default all.
        """
        log_weight = -0.5 * cdist(queries, self.Z, "sqeuclidean")
        if seen is not None:
            log_weight = np.where(seen, log_weight, -np.inf)
        log_weight -= logsumexp(log_weight, axis=1, keepdims=True)
        variance = self.width_m**2
        log_kernel = -0.5 * cdist(p_RE, self.p_RE, "sqeuclidean") / variance
        log_kernel -= np.log(2.0 * np.pi * variance)
        density: Vector = logsumexp(log_weight + log_kernel, axis=1)
        return np.logaddexp(np.log1p(-OUTLIERS) + density, np.log(OUTLIERS))
