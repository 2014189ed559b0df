import numpy as np
import pyarrow as pa

from lic_drake.estimate.rollouts import read_rollouts
from lic_drake.evaluate.decisions import fit_rollouts
from lic_drake.show.decisions import decisions_figure


def test_the_map_has_the_choice_at_its_top_and_the_nearest_attempts_as_dots() -> None:
    rng = np.random.default_rng(0)
    columns = dict(zip("abcs", rng.uniform(size=(4, 400)), strict=True))
    a, b, _, s = columns.values()
    columns["success"] = rng.uniform(size=400) < np.exp(-9.0 * ((a - s) ** 2 + (b - 0.7) ** 2))
    known = read_rollouts(pa.table(columns), decide=["a", "b", "c"], given=["s"])
    model = fit_rollouts(known, "knn")
    chosen = model.choose({"s": 0.3})
    ax = decisions_figure(model, chosen).axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("a", "b")
    near = np.argsort(np.abs(s - 0.3))[:100]
    for dots, success in zip(ax.collections[1:], (True, False), strict=True):
        expected = near[columns["success"][near] == success]
        shown = np.asarray(dots.get_offsets())
        np.testing.assert_allclose(np.sort(shown[:, 0]), np.sort(a[expected]))
        assert len(dots.get_facecolor()) == success  # Filled or not.
    (star,) = ax.lines
    np.testing.assert_allclose(star.get_xydata()[0], list(chosen.values.values())[:2])
    drawn = np.asarray(ax.collections[0].get_array())
    assert chosen.estimate - 0.03 < drawn.max() < chosen.estimate + 1e-6
