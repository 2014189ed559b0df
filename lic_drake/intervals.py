"""Wilson score intervals of success rates."""

import math
from statistics import NormalDist


def wilson_interval(successes: int, n: int, confidence: float = 0.9) -> tuple[float, float]:
    """Returns the Wilson score interval of a binomial proportion (Wilson 1927).

    It is (0, 1) without trials. The paper shows a confidence of 0.9. Raises a ValueError if the
    counts or the confidence are out of range.
    """
    if not 0 <= successes <= n:
        raise ValueError(f"successes must be from 0 to n, got {successes} of {n}")
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"confidence must be between 0 and 1, got {confidence}")
    if n == 0:
        return 0.0, 1.0
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    centre = successes + 0.5 * z**2
    half_width = z * math.sqrt(successes * (n - successes) / n + 0.25 * z**2)
    # Exactly 0 without successes and exactly 1 without failures.
    low = (centre - half_width) / (n + z**2) if successes > 0 else 0.0
    high = (centre + half_width) / (n + z**2) if successes < n else 1.0
    return low, high
