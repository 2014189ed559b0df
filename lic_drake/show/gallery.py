"""A gallery as one static page: per category, the first trials that succeed and that fail."""

import html
import io
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

import lic_drake
from lic_drake.evaluate.paper import label
from lic_drake.evaluate.trial import Attempt, run_trial
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import Scenario
from lic_drake.reach.session import simulate_request
from lic_drake.reach.start import describe_start
from lic_drake.select.registry import make_selector
from lic_drake.show.figures import ShownTrial, is_reachable
from lic_drake.show.page import embed, make_page, picture
from lic_drake.show.pictures import path_figure, record_trial
from lic_drake.types import Vector

MAX_ENVIRONMENTS = 300
"""Number of environments that are tried for a success, and a failure."""

ATTEMPTS = 2
"""Largest number of attempts at a goal."""

STREAM = "evaluation"
"""Seed stream of the environments; none of them is in a library."""

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
.stage { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); gap: 1rem; }
.scene button { font: inherit; margin-bottom: 0.5rem; cursor: pointer; }
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; border-bottom: 1px solid #eee; }
"""


@dataclass(frozen=True, kw_only=True)
class Exhibit:
    """A trial of the gallery, in an environment of the stream `STREAM`.

    Attributes:
        recording: All attempts as a page that plays offline.
        view: View from above with all attempts, a PNG image.
    """

    scenario: Scenario
    environment: int
    p_WG: Vector
    attempts: list[Attempt]
    recording: str
    view: bytes

    @property
    def success(self) -> bool:
        """Whether the last attempt reached the goal."""
        return self.attempts[-1].record.success


def choose_exhibits(
    library: ExperienceLibrary,
    method: str = "gp",
    each: int = 1,
    first_environment: int = 0,
    say: Callable[[str], None] = print,
) -> list[Exhibit]:
    """Returns the first trials that reach their goal and the first that do not.

    Environments are taken in order, so that nothing is cherry-picked; those whose goal is out of
    the arm's reach are skipped. There are at most `each` of both; `say` receives a message for
    every one. The library gives the scenario, too.
    """
    scenario = library.scenario()
    selector = make_selector(
        method,
        scenario.arm(),
        library.columns(),
        np.random.default_rng(first_environment),
        scenario.category,
        say=say,
    )
    wanted = {True: each, False: each}
    exhibits = []
    goals = ((i, scenario.sample_goal(STREAM, i)) for i in itertools.count(first_environment))
    reachable = (pair for pair in goals if is_reachable(scenario, STREAM, *pair))
    for environment, p_WG in itertools.islice(reachable, MAX_ENVIRONMENTS):
        done = run_trial(scenario, selector, STREAM, environment, p_WG, ATTEMPTS)
        success = done[-1].record.success
        if wanted[success] == 0:
            continue
        wanted[success] -= 1
        exhibits.append(_exhibit(scenario, environment, p_WG, done))
        outcomes = ", ".join(attempt.record.outcome for attempt in done)
        say(f"{scenario.category}, environment {environment}: {outcomes}")
        if not any(wanted.values()):
            break
    return sorted(exhibits, key=lambda exhibit: not exhibit.success)


def _exhibit(scenario: Scenario, environment: int, p_WG: Vector, done: list[Attempt]) -> Exhibit:
    """Simulates the attempts of a trial again, with everything that is shown of them."""
    instance = scenario.sample_instance(STREAM, environment)
    traces = [simulate_request(attempt.request, keep_states=True).trace for attempt in done]
    trial = ShownTrial(
        scenario=scenario, instance=instance, p_WG=p_WG, attempts=done, traces=traces
    )
    view = io.BytesIO()
    path_figure(trial).savefig(view, format="png", dpi=80)
    return Exhibit(
        scenario=scenario,
        environment=environment,
        p_WG=p_WG,
        attempts=done,
        recording=record_trial(trial).html(),
        view=view.getvalue(),
    )


def make_gallery(exhibits: Sequence[Exhibit], method: str) -> str:
    """Returns the page; opened at `#<category>-<environment>` it plays that recording at once."""
    parts = [
        f"<p>Starts selected by {html.escape(label(method))} in environments that are in no"
        " experience library: for each category the first environments in which the goal was"
        " reached, and the first in which it was not. Each row is one reach.</p>"
    ]
    for category in dict.fromkeys(exhibit.scenario.category for exhibit in exhibits):
        parts.append(f"<h2>{html.escape(category)}</h2>")
        parts += [_section(e) for e in exhibits if e.scenario.category == category]
    versions = sorted({exhibit.attempts[0].record.drake_version for exhibit in exhibits})
    parts.append(
        f"<footer>Made by lic_drake {lic_drake.__version__} with Drake"
        f" {html.escape(', '.join(versions))}; the page needs no network.</footer>"
    )
    return make_page("Reaches into clutter", "\n".join(parts), _STYLE)


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
    name = html.escape(f"{exhibit.scenario.category}-{exhibit.environment}", quote=True)
    word, kind = ("reached", "reached") if exhibit.success else ("not reached", "missed")
    goal = ", ".join(f"{value:.3f}" for value in exhibit.p_WG)
    rows = "\n".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in _cells(number, attempt))}</tr>"
        for number, attempt in enumerate(exhibit.attempts, start=1)
    )
    return f"""<section id="{name}">
<h3>Environment {exhibit.environment}, goal ({goal}) m: <span class="{kind}">{word}</span></h3>
<div class="stage">
{picture(exhibit.view, "image/png", alt=f"{name} from above")}
<div class="scene">{embed(exhibit.recording, name, button="Play the recording")}</div>
</div>
<table>
<tr>{"".join(f"<th>{head}</th>" for head in HEADS)}</tr>
{rows}
</table>
<p><small>Scenario {exhibit.scenario.digest}, seed stream {STREAM}.</small></p>
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
