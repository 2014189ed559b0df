"""A gallery as one static page: for each library, the first trials that succeed and that fail."""

import html
import io
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image

import lic_drake
from lic_drake.evaluate.paper import label
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import simulate_request
from lic_drake.reach.start import describe_start
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import Selector, make_selector
from lic_drake.show.figures import ShownTrial, is_reachable
from lic_drake.show.page import embed, make_page, picture
from lic_drake.show.pictures import PICTURES_STYLE, save_pictures, show_pictures
from lic_drake.starts import make_starts
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 300
"""Number of environments that are tried for a success, and a failure."""

ATTEMPTS = 2
"""Largest number of attempts at a goal."""

STREAM = "evaluation"
"""Seed stream of the environments; none of them is in a library."""

WIDTH = 800
"""Width of stills on the page, pixels; figures are twice as wide."""

HEADS = (
    "attempt",
    "start",
    "estimated success, %",
    "outcome",
    "simulated, s",
    "nearest to goal, mm",
    "peak force, N",
)
"""Heads of the table of attempts."""

_STYLE = """
section { background: #fff; border: 1px solid #ddd; border-radius: 6px; padding: 1rem;
  margin: 1rem 0; }
.reached { color: #1a7f37; } .missed { color: #b42318; }
.scene button { font: inherit; margin: 0.5rem 0; cursor: pointer; }
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; border-bottom: 1px solid #eee; }
"""


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A trial of the gallery, in an environment of the stream `STREAM`.

    Attributes:
        recording: All attempts as a page that plays offline.
        pictures: WebP images by kind, see `lic_drake.show.pictures.save_pictures`; stills only
            where they can be rendered, estimates only of a strategy that has any.
    """

    scenario: Scenario
    environment: int
    p_WG: Vector
    attempts: list[Attempt]
    recording: str
    pictures: dict[str, bytes]

    @property
    def success(self) -> bool:
        """Whether the last attempt reached the goal."""
        return self.attempts[-1].record.success

    @property
    def name(self) -> str:
        """Robot, category and environment, as in the address of the page."""
        return f"{self.scenario.arm().name}-{self.scenario.category}-{self.environment}"


def choose_exhibits(
    library: ExperienceLibrary,
    method: str = "gp",
    each: int = 1,
    first_environment: int = 0,
    say: Callable[[str], None] = print,
    overrides: str = "",
) -> list[Exhibit]:
    """Returns the first trials that reach their goal and the first that do not.

    Environments are taken in order, so that nothing is cherry-picked; those whose goal is out of
    the arm's reach are skipped. There are at most `each` of both; `say` receives a message for
    every trial. The library gives the scenario, too, with values of YAML text put over it.
    """
    scenario = library.scenario(overrides)
    rng = np.random.default_rng(first_environment)
    selector = make_selector(method, library.columns(), rng, say)
    wanted = {True: each, False: each}
    exhibits: list[Exhibit] = []
    goals = ((i, scenario.sample_goal(STREAM, i)) for i in itertools.count(first_environment))
    reachable = (pair for pair in goals if is_reachable(scenario, STREAM, *pair))
    for environment, p_WG in itertools.islice(reachable, MAX_ENVIRONMENTS):
        done = run_trial(scenario, selector, STREAM, environment, p_WG, ATTEMPTS)
        success = done[-1].record.success
        if wanted[success]:
            wanted[success] -= 1
            exhibits.append(_exhibit(scenario, selector, environment, p_WG, done, say))
        outcomes = ", ".join(attempt.record.outcome for attempt in done)
        say(
            f"{scenario.arm().name} in {scenario.category}, environment {environment}: {outcomes};"
            f" {len(exhibits)} of {2 * each} trials"
        )
        if not any(wanted.values()):
            break
    return sorted(exhibits, key=lambda exhibit: not exhibit.success)


def _exhibit(
    scenario: Scenario,
    selector: Selector,
    environment: int,
    p_WG: Vector,
    done: list[Attempt],
    say: Callable[[str], None],
) -> Exhibit:
    """Simulates the attempts of a trial again, with everything that is shown of them."""
    instance = scenario.sample_instance(STREAM, environment)
    traces = [simulate_request(attempt.request, keep_states=True).trace for attempt in done]
    trial = ShownTrial(
        scenario=scenario, instance=instance, p_WG=p_WG, attempts=done, traces=traces
    )
    estimates = selector if isinstance(selector, LicSelector) else None
    known = make_starts(scenario, instance)
    with TemporaryDirectory() as folder:
        files = save_pictures(trial, estimates, known, Path(folder), say, film=False)
        recording = files.pop("recording").read_text(encoding="utf-8")
        pictures = {kind: _small(path) for kind, path in files.items()}
    return Exhibit(
        scenario=scenario,
        environment=environment,
        p_WG=p_WG,
        attempts=done,
        recording=recording,
        pictures=pictures,
    )


def _small(path: Path) -> bytes:
    """Returns a picture as WebP, a tenth of its size."""
    with Image.open(path) as image:
        width = 2 * WIDTH if image.width > 2 * WIDTH else min(image.width, WIDTH)
        size = (width, round(width * image.height / image.width))
        content = io.BytesIO()
        image.convert("RGB").resize(size).save(content, format="WEBP", quality=80)
    return content.getvalue()


def make_gallery(exhibits: Sequence[Exhibit], method: str) -> str:
    """Returns the page; opened at `#` and the name of an exhibit it plays its recording at once."""
    parts = [
        f"<p>Starts selected by {html.escape(label(method))} in environments that are in no"
        " experience library: for each robot and category the first environments in which the goal"
        " was reached, and the first in which it was not. Each row is one reach.</p>",
        *map(_section, exhibits),
    ]
    versions = sorted({exhibit.attempts[0].record.drake_version for exhibit in exhibits})
    parts.append(
        f"<footer>Made by lic_drake {lic_drake.__version__} with Drake"
        f" {html.escape(', '.join(versions))}; the page needs no network.</footer>"
    )
    return make_page("Reaches into clutter", "\n".join(parts), PICTURES_STYLE + _STYLE)


def numbers_of(number: int, attempt: Attempt) -> dict[str, object]:
    """Returns the numbers of an attempt, from 1; None where nothing was measured or estimated."""
    start, record = attempt.selection.start, attempt.record
    values = {
        "estimated_success": attempt.selection.probability,
        "duration_s": record.duration_s,
        "min_distance_m": record.min_distance,
        "peak_force_N": record.peak_force,
    }
    return {
        "attempt": number,
        "start": start.x0.tolist(),
        "base": start.b0.tolist(),
        "outcome": record.outcome,
        **{k: None if v is None or math.isnan(v) else v for k, v in values.items()},
    }


def _section(exhibit: Exhibit) -> str:
    """Returns a trial's part of the page."""
    scenario, name = exhibit.scenario, html.escape(exhibit.name, quote=True)
    word, kind = ("reached", "reached") if exhibit.success else ("not reached", "missed")
    goal = ", ".join(f"{value:.3f}" for value in exhibit.p_WG)
    rows = "\n".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in _cells(number, attempt))}</tr>"
        for number, attempt in enumerate(exhibit.attempts, start=1)
    )

    def show(kind: str, words: str) -> str:
        return picture(exhibit.pictures[kind], "image/webp", words)

    return f"""<section id="{name}">
<h2>{html.escape(f"{scenario.arm().name} in {scenario.category}")}, environment
{exhibit.environment}: <span class="{kind}">{word}</span></h2>
<table>
<tr>{"".join(f"<th>{head}</th>" for head in HEADS)}</tr>
{rows}
</table>
<div class="scene">{embed(exhibit.recording, name, button="Play the recording")}</div>
{show_pictures(exhibit.attempts, exhibit.pictures, show)}
<p><small>Goal ({goal}) m, scenario {scenario.digest}, seed stream {STREAM}.</small></p>
</section>"""


def _cells(number: int, attempt: Attempt) -> list[str]:
    """Returns a row of the table of attempts, in the order of `HEADS`."""
    record, probability = attempt.record, attempt.selection.probability
    figures = (
        ("{:.1f}", record.duration_s),
        ("{:.0f}", 1000.0 * record.min_distance),
        ("{:.1f}", record.peak_force),
    )
    return [
        str(number),
        describe_start(attempt.selection.start),
        "–" if probability is None else f"{100.0 * probability:.0f}",
        record.outcome,
        *("–" if math.isnan(value) else form.format(value) for form, value in figures),
    ]
