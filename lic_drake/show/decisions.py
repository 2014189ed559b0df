"""A map of the estimated success over decisions, with the attempts that it was learned from."""

import numpy as np
from matplotlib.figure import Figure

from lic_drake.estimate.rows import feature_scale
from lic_drake.evaluate.decisions import Decision, DecisionModel

_LATTICE, _SHOWN = 81, 100


def decisions_figure(model: DecisionModel, chosen: Decision) -> Figure:
    """Returns the map of a situation over the first two decision columns; others are as chosen.

    Dots are the 100 attempts whose situations are nearest, in standard deviations of the columns;
    successes are filled. A star is the choice.
    """
    rollouts = model.rollouts
    situation, decisions = rollouts.situation(chosen.at), rollouts.decisions
    low, high = decisions.min(axis=0)[:2], decisions.max(axis=0)[:2]
    x, y = np.linspace(low, high, _LATTICE).T
    asked = np.tile(list(chosen.values.values()), (_LATTICE**2, 1))
    asked[:, :2] = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    values = np.clip(model.values(situation, asked), 0.0, 1.0).reshape(_LATTICE, _LATTICE)

    figure = Figure(figsize=(7.0, 5.2), layout="constrained")
    ax = figure.subplots()
    image = ax.pcolormesh(x, y, values, cmap="viridis", vmin=0.0, vmax=1.0, shading="nearest")
    away = (rollouts.situations - situation) / feature_scale(rollouts.situations)
    near = np.argsort(np.linalg.norm(away, axis=1), kind="stable")[:_SHOWN]
    for success, face in ((1.0, "white"), (0.0, "none")):
        dots = decisions[near[rollouts.rows.y[near] == success]]
        label = f"{len(dots)} {'successes' if success else 'failures'} in like situations"
        ax.scatter(dots[:, 0], dots[:, 1], s=22, c=face, edgecolors="white", label=label)
    star = list(chosen.values.values())[:2]
    ax.plot(*star, "*", ms=18, color="tab:red", mec="white", clip_on=False, label="choice", ls="")
    ax.set(xlabel=rollouts.decide[0], ylabel=rollouts.decide[1])
    ax.set_title(", ".join(f"{name} {value:.3g}" for name, value in chosen.at.items()), fontsize=10)
    # Beside the map, as dots may be anywhere on it.
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, facecolor="0.6")
    figure.colorbar(image, ax=ax, label="estimated probability of success")
    return figure
