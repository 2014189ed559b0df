"""What every success estimator offers."""

from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

from numpy.typing import ArrayLike

from lic_drake.types import Vector


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Estimates for n queries.

    Attributes:
        probability: Estimated probability of success, shape (n,), within [0, 1].
        spread: Standard deviation of that estimate, shape (n,); each estimator says of what.
    """

    probability: Vector
    spread: Vector


class Predictor(Protocol):
    """An estimate of P(success) that can be fitted and asked, as cross-validation needs it."""

    def fit(self, Z: ArrayLike, f: ArrayLike, environment: ArrayLike | None = None) -> Self:
        """Learns from rows and returns itself.

        Args:
            Z: Features, shape (n, d), see `lic_drake.estimate.features`.
            f: Successes, shape (n,), each 0 or 1.
            environment: Index of each row's environment, shape (n,). Reaches in one environment
                succeed and fail together; an estimator that knows them smooths more.

        Raises:
            EstimateError: The rows are unusable.
        """
        ...

    def predict(self, Z: ArrayLike) -> Prediction:
        """Estimates P(success) for queries Z, shape (n, d).

        Raises:
            EstimateError: Not fitted yet, or queries that do not fit.
        """
        ...


class SuccessEstimator(Predictor, Protocol):
    """F(s, x0) of paper III-D with its gradient, for the optimisation of Eq. (4).

    Estimates are not clipped into [0, 1] here: a clipped one is flat where an optimiser needs to
    climb, and would tie the best starts with each other.
    """

    def values(self, Z: ArrayLike) -> Vector:
        """Returns the estimates for queries Z, shape (n, d): shape (n,).

        Many at a time: candidates of one situation take a few milliseconds in all.

        Raises:
            EstimateError: Not fitted yet, or queries that do not fit.
        """
        ...

    def value_and_gradient(self, z: ArrayLike) -> tuple[float, Vector]:
        """Returns the estimate at z, shape (d,), and its gradient by z, shape (d,).

        Raises:
            EstimateError: Not fitted yet, or a query that does not fit.
        """
        ...


@runtime_checkable
class UpdatableEstimator(SuccessEstimator, Protocol):
    """An estimator that goes on learning: what it learned from before is kept (paper VII)."""

    def update(self, Z: ArrayLike, f: ArrayLike, weight: ArrayLike = 1.0) -> Self:
        """Takes further rows in and returns itself; its settings stay as `fit` chose them.

        Args:
            Z: Features, shape (n, d).
            f: Successes, shape (n,), each 0 or 1.
            weight: How many of the reaches of `fit` a row counts as, one number or shape (n,).

        Raises:
            EstimateError: Not fitted yet, or the rows or weights are unusable.
        """
        ...
