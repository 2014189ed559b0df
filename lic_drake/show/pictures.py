"""A demonstration's output: recording, figures, stills, film and page."""

from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from lic_drake.errors import RenderingError
from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.observer import Observer
from lic_drake.reach.trace import ReachTrace
from lic_drake.select.lic import LicSelector
from lic_drake.show.apertures import apertures_figure
from lic_drake.show.density import densities_figure
from lic_drake.show.detections import look_figure, maps_figure
from lic_drake.show.figures import ShownTrial, save_figure
from lic_drake.show.film import film_frames, save_film
from lic_drake.show.page import linked, make_page
from lic_drake.show.recording import Recording
from lic_drake.show.stills import StillCamera, save_stills
from lic_drake.show.views import SIDE, TOP, draw_view
from lic_drake.starts import BoardStarts, LineStarts

_OLD = (
    *("density.png", "apertures.png", "look[1-9].png", "film.webp", "index.html"),
    *(f"attempt[1-9]_{moment}.png" for moment in ("start", "middle", "end", "inside")),
)


_FIGURES = {
    "density": "Estimated probability of success over the starts, before each attempt.",
    "apertures": "Estimated probability of success through each aperture, before each attempt.",
    "path": "The way of the arm.",
}

PICTURES_STYLE = (
    "img { width: auto; max-width: 100%; max-height: 38rem; }"
    " .row { display: flex; gap: 1rem; } .row figure { flex: 1; }"
)
"""CSS of pages with `show_pictures`."""


def remove_pictures(out: Path) -> None:
    """Removes pictures of an earlier demonstration, not all of which the new one overwrites."""
    for old in (path for pattern in _OLD for path in out.glob(pattern)):
        old.unlink()


def save_pictures(
    trial: ShownTrial,
    selector: LicSelector | None,
    known: Observer | BoardStarts | LineStarts,
    out: Path,
    say: Callable[[str], None] = print,
    drake_models: Path | None = None,
    film: bool = True,
) -> dict[str, Path]:
    """Writes demo.html, path.png, film.webp and `lic_drake.show.stills.save_stills`'s stills.

    In the plane also density.png, in front of a board apertures.png, and with cameras look1.png and
    so on. The estimates are the selector's, if there is one; `known` is
    what the robot observed, or the feasible starts if it knows them. Returns the files by kind;
    where nothing can be rendered, `say` receives a warning, and there are neither film nor stills.
    A film takes longer than all else. A LicError says which file cannot be written.
    """
    attempts = trial.attempts
    recording = record_trial(trial, drake_models)
    files: dict[str, Path] = {"recording": out / "demo.html"}
    recording.save(files["recording"])

    def save(kind: str, name: str, figure: Figure) -> None:
        files[kind] = out / name
        save_figure(figure, files[kind])

    save("path", "path.png", path_figure(trial))
    files |= save_rendered(trial, out, say, drake_models, film)
    if selector is None:
        return files
    if isinstance(known, Observer):
        save("apertures", "apertures.png", maps_figure(selector, known, attempts))
        for number in range(1, len(attempts) + 1):
            figure = look_figure(selector, known, attempts, number)
            save(f"look {number}", f"look{number}.png", figure)
    elif isinstance(known, BoardStarts):
        save("apertures", "apertures.png", apertures_figure(selector, known, attempts))
    else:
        save("density", "density.png", densities_figure(selector, known, attempts))
    return files


def save_rendered(
    trial: ShownTrial,
    out: Path,
    say: Callable[[str], None],
    drake_models: Path | None = None,
    film: bool = True,
) -> dict[str, Path]:
    """Writes stills and film, see `save_pictures`; returns the files by kind."""
    try:
        camera = StillCamera(trial.scenario, trial.instance, trial.p_WG, drake_models)
    except RenderingError as error:
        say(f"no stills and no film: {error}")
        return {}
    files = save_stills(trial, camera, out)
    if files and film:
        files["film"] = out / "film.webp"
        save_film(film_frames(trial, drake_models), files["film"])
    return files


def record_trial(trial: ShownTrial, drake_models: Path | None = None) -> Recording:
    """Returns a recording of all attempts; a PR2 moves base, torso and arm to each start."""
    scenario, instance = trial.scenario, trial.instance
    approach = not scenario.arm().is_planar
    recording = Recording(scenario, instance, drake_models, approach)
    before: ReachTrace | None = None
    for caption, trace in labelled(trial):
        if approach and trace.q:
            if before is not None:
                recording.retract(before)
            recording.move_to(trace.b0, trace.q[0])
            before = trace
        recording.add_reach(trace, trial.p_WG, caption)
    return recording


def labelled(trial: ShownTrial) -> list[tuple[str, ReachTrace]]:
    """Returns the traces of all attempts, each with its number and outcome in words."""
    return [(f"attempt {i}: {a.record.outcome}", t) for i, (a, t) in enumerate(trial, start=1)]


def path_figure(trial: ShownTrial) -> Figure:
    """Returns views of all attempts from above and, in space, from the side."""
    views = (TOP,) if trial.scenario.arm().is_planar else (TOP, SIDE)
    figure = Figure(figsize=(7 * len(views), 7), layout="constrained")
    for ax, axes in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        draw_view(ax, trial.scenario, trial.instance, trial.p_WG, labelled(trial), axes)
    return figure


def index_page(title: str, attempts: Sequence[Attempt], files: Mapping[str, Path]) -> str:
    """Returns a page that shows and links what was written beside it, by kind (paper Fig. 2)."""
    shown = show_pictures(attempts, files, lambda kind, words: linked(files[kind].name, words))
    links = (
        f'<p><a href="{files["recording"].name}">The recording</a>, to turn and to play, and'
        f' <a href="{files["data"].name}">all numbers</a>.</p>'
    )
    return make_page(title, f"{shown}\n{links}", PICTURES_STYLE)


def show_pictures(
    attempts: Sequence[Attempt], kinds: Collection[str], show: Callable[[str, str], str]
) -> str:
    """Returns the pictures of a trial as HTML; `show` makes it of a kind and a plain caption."""
    parts = []
    if "film" in kinds:
        parts.append(show("film", "All attempts. Arrows are contact forces."))
    for number, attempt in enumerate(attempts, start=1):
        words = f"Attempt {number}: {attempt.record.outcome}"
        if attempt.selection.probability is not None:
            words += f", estimated success {100.0 * attempt.selection.probability:.0f} %"
        parts.append(f"<h3>{words}</h3>")
        if f"look {number}" in kinds:
            words = "What the cameras saw: open apertures, passable probabilities and the goal."
            parts.append(show(f"look {number}", words))
        moments = [kind for kind in kinds if kind.startswith(f"attempt {number} ")]
        stills = (show(kind, kind.split()[-1]) for kind in moments)
        parts.append(f'<div class="row">{"".join(stills)}</div>')
    parts.append("<h3>What was believed, and the way</h3>")
    parts += [show(kind, words) for kind, words in _FIGURES.items() if kind in kinds]
    return "\n".join(parts)
