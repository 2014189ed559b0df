"""A demonstration's output: recording, figures, stills, film and page."""

from collections.abc import Callable, Mapping, Sequence
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
from lic_drake.show.page import embed, make_page, picture
from lic_drake.show.recording import Recording
from lic_drake.show.stills import StillCamera, save_stills
from lic_drake.show.views import SIDE, TOP, draw_view
from lic_drake.starts import BoardStarts, LineStarts

_OLD = (
    *("density.png", "apertures.png", "look[1-9].png", "film.webp", "sequence.html"),
    *(f"attempt[1-9]_{moment}.png" for moment in ("start", "middle", "end", "inside")),
)


def remove_pictures(out: Path) -> None:
    """Removes pictures of an earlier demonstration, not all of which the new one overwrites."""
    for old in (path for pattern in _OLD for path in out.glob(pattern)):
        old.unlink()


def save_pictures(
    trial: ShownTrial,
    selector: LicSelector,
    known: Observer | BoardStarts | LineStarts,
    out: Path,
    say: Callable[[str], None] = print,
    drake_models: Path | None = None,
) -> dict[str, Path]:
    """Writes demo.html, path.png, film.webp and `lic_drake.show.stills.save_stills`'s stills.

    In the plane also density.png, in front of a board apertures.png, and with cameras look1.png and
    so on, and sequence.html (all of it on one page). The estimates are the selector's; `known` is
    what the robot observed, or the feasible starts if it knows them. Returns the files by kind;
    where nothing can be rendered, `say` receives a warning, and there are neither film nor stills.
    A LicError says which file cannot be written.
    """
    attempts = trial.attempts
    recording = record_trial(trial, drake_models)
    files: dict[str, Path] = {"recording": out / "demo.html"}
    recording.save(files["recording"])

    def save(kind: str, name: str, figure: Figure) -> None:
        files[kind] = out / name
        save_figure(figure, files[kind])

    save("path", "path.png", path_figure(trial))
    files |= save_rendered(trial, out, say, drake_models)
    if isinstance(known, Observer):
        save("apertures", "apertures.png", maps_figure(selector, known, attempts))
        for number in range(1, len(attempts) + 1):
            figure = look_figure(selector, known, attempts, number)
            save(f"look {number}", f"look{number}.png", figure)
        files["sequence"] = out / "sequence.html"
        page = _sequence_page(known, attempts, files, recording)
        files["sequence"].write_text(page, encoding="utf-8")
    elif isinstance(known, BoardStarts):
        save("apertures", "apertures.png", apertures_figure(selector, known, attempts))
    else:
        save("density", "density.png", densities_figure(selector, known, attempts))
    return files


def save_rendered(
    trial: ShownTrial, out: Path, say: Callable[[str], None], drake_models: Path | None = None
) -> dict[str, Path]:
    """Writes stills and film, see `save_pictures`; returns the files by kind."""
    try:
        camera = StillCamera(trial.scenario, trial.instance, trial.p_WG, drake_models)
    except RenderingError as error:
        say(f"no stills and no film: {error}")
        return {}
    files = save_stills(trial, camera, out)
    if files:
        files["film"] = out / "film.webp"
        save_film(film_frames(trial, drake_models), files["film"])
    return files


def record_trial(trial: ShownTrial, drake_models: Path | None = None) -> Recording:
    """Returns a recording of all attempts; a PR2 moves base, torso and arm to each start."""
    scenario, instance = trial.scenario, trial.instance
    approach = not scenario.arm().is_planar
    recording = Recording(scenario, instance, drake_models, approach)
    before: ReachTrace | None = None
    for trace in trial.traces:
        if approach and trace.q:
            if before is not None:
                recording.retract(before)
            recording.move_to(trace.b0, trace.q[0])
            before = trace
        recording.add_reach(trace, trial.p_WG)
    return recording


def path_figure(trial: ShownTrial) -> Figure:
    """Returns views of all attempts from above and, in space, from the side."""
    views = (TOP,) if trial.scenario.arm().is_planar else (TOP, SIDE)
    figure = Figure(figsize=(7 * len(views), 7), layout="constrained")
    labelled = [(f"attempt {i}: {a.record.outcome}", t) for i, (a, t) in enumerate(trial, start=1)]
    for ax, axes in zip(figure.subplots(1, len(views), squeeze=False)[0], views, strict=True):
        draw_view(ax, trial.scenario, trial.instance, trial.p_WG, labelled, axes)
    return figure


def _sequence_page(
    observer: Observer,
    attempts: Sequence[Attempt],
    files: Mapping[str, Path],
    recording: Recording,
) -> str:
    """Returns the whole sequence of looks and reaches as one page (paper Fig. 2)."""
    word = "reached" if observer.touches_ball(attempts[-1].record) else "not reached"
    parts = [
        "<p>The robot looks, selects an aperture, a place for its base and a height for its torso,"
        " moves base, torso and arm in that order, and reaches. After a failure it looks and"
        " selects again. Arrows are contact forces.</p>",
        embed(recording.html(), height_px=540),
    ]
    if "film" in files:
        words = "All attempts, twice as fast, from the right and from behind the board"
        parts.append(picture(files["film"].read_bytes(), "image/webp", words))
    for number, attempt in enumerate(attempts, start=1):
        words = f"Look {number}: open apertures, passable probabilities and goal. Attempt {number}:"
        words += f" {attempt.record.outcome}"
        if attempt.selection.probability is not None:
            words += f", estimated success {100.0 * attempt.selection.probability:.0f} %"
        data = files[f"look {number}"].read_bytes()
        parts.append(picture(data, "image/png", words + "."))
    title = f"{observer.scenario.category}, environment {observer.environment}: {word}"
    return make_page(title, "\n".join(parts))
