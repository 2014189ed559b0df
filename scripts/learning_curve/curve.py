"""How good the selected starts are when an estimator has learned from less."""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from scipy.stats import t as student_t

from lic_drake.errors import LibraryError
from lic_drake.estimate.cross_validation import selection_success
from lic_drake.estimate.estimator import Predictor
from lic_drake.estimate.features import ExperienceRows
from lic_drake.estimate.folds import environment_folds
from lic_drake.evaluate.figures import COLORS
from lic_drake.evaluate.paper import label
from lic_drake.experience.files import readable_errors
from lic_drake.seeds import make_generator

_COLUMNS = ("estimator", "size", "value", "low", "high")


@dataclass(frozen=True, kw_only=True)
class LearningPoint:
    """Success of the selected starts after learning from a part of a library.

    Attributes:
        size: Number of reaches that the estimator learned from, a mean over the folds.
        value: Mean over held-out environments of the selected starts' share of successes.
        low: Lower end of its 90 % interval.
        high: Upper end.
    """

    size: int
    value: float
    low: float
    high: float


def learning_point(
    make: Callable[[], Predictor],
    rows: ExperienceRows,
    situation: slice,
    size: int,
    *,
    folds: int = 10,
) -> LearningPoint:
    """Measures the selection among each held-out environment's starts, learning from `size` rows.

    The rows are drawn from all environments of the other folds. The interval is Student's over
    environments; it does not cover what other rows would have taught.

    Args:
        make: Returns a new, unfitted estimator.
        rows: Reaches with several starts for each goal of an environment.
        situation: The part of z that is given.
        size: Number of reaches to learn from; all of the other folds' if there are fewer.
        folds: Number of groups of environments.

    Raises:
        EstimateError: Fewer than two environments or folds, or rows that cannot be fitted.
    """
    fold = environment_folds(rows.environment, folds)
    probability = np.empty(len(rows.f))
    sizes = []
    for held_out in range(fold.max() + 1):
        out = fold == held_out
        rng = make_generator("training", "learning curve", size, held_out)
        pool = np.flatnonzero(~out)
        part = rng.choice(pool, size=min(size, len(pool)), replace=False)
        sizes.append(len(part))
        estimator = make().fit(rows.Z[part], rows.f[part], rows.environment[part])
        probability[out] = estimator.predict(rows.Z[out]).probability
    success = selection_success(probability, rows, situation)
    mean, n = float(success.mean()), len(success)
    half_width = float(student_t.ppf(0.95, n - 1) * success.std(ddof=1) / np.sqrt(n))
    return LearningPoint(
        size=round(float(np.mean(sizes))),
        value=mean,
        low=max(0.0, mean - half_width),
        high=min(1.0, mean + half_width),
    )


def write_learning_curves(path: Path, curves: Mapping[str, Sequence[LearningPoint]]) -> None:
    """Writes points by estimator as CSV, making the folder if it is not there.

    Raises:
        LibraryError: The system refuses.
    """
    with readable_errors(path, "write"):
        path.parent.mkdir(parents=True, exist_ok=True)
        file = path.open("w", newline="", encoding="utf-8")
    with file:
        writer = csv.writer(file)
        writer.writerow(_COLUMNS)
        for name, points in curves.items():
            writer.writerows((name, p.size, p.value, p.low, p.high) for p in points)


def read_learning_curves(path: Path) -> dict[str, list[LearningPoint]]:
    """Reads points by estimator.

    Raises:
        LibraryError: The file is missing or not of this kind.
    """
    curves: dict[str, list[LearningPoint]] = {}
    try:
        with path.open(newline="", encoding="utf-8") as file:
            for row in csv.DictReader(file):
                point = LearningPoint(
                    size=int(row["size"]),
                    value=float(row["value"]),
                    low=float(row["low"]),
                    high=float(row["high"]),
                )
                curves.setdefault(row["estimator"], []).append(point)
    except FileNotFoundError:
        raise LibraryError(
            f"no learning curve at {path}; make it with: python scripts/learning_curve/run.py"
        ) from None
    except (OSError, ValueError, KeyError, TypeError, csv.Error) as error:
        raise LibraryError(f"{path} is no learning curve ({error}); make it again") from None
    return curves


def draw_learning_curve(
    ax: Axes, curves: Mapping[str, Sequence[LearningPoint]], ylabel: str
) -> Axes:
    """Draws scores against the size of the library, on a logarithmic axis.

    Args:
        ax: Where to draw.
        curves: Points by estimator.
        ylabel: What the score is, with its unit.
    """
    for i, (name, points) in enumerate(curves.items()):
        ordered = sorted(points, key=lambda point: point.size)
        value = np.array([point.value for point in ordered])
        ends = np.array([[point.low, point.high] for point in ordered]).T
        ax.errorbar(
            [point.size for point in ordered],
            value,
            yerr=np.abs(ends - value),
            color=COLORS.get(name),
            marker="os"[i % 2],
            capsize=3,
            label=label(name),
        )
    ax.set(xscale="log", xlabel="reaches in the library", ylabel=ylabel)
    ax.legend(fontsize=8)
    return ax
