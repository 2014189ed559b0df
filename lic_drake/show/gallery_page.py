"""A gallery as one static page: recordings, stills and numbers, nothing beside it."""

import base64
import html
import math
from collections.abc import Sequence

import numpy as np

import lic_drake
from lic_drake.evaluate.paper import label
from lic_drake.evaluate.trial import Attempt
from lic_drake.show.embed import UNPACK, pack
from lic_drake.show.exhibits import STREAM, Exhibit

HEADS = (
    "attempt",
    "start y, m",
    "start φ, °",
    "base y, m",
    "estimated success, %",
    "outcome",
    "simulated, s",
    "nearest to goal, mm",
    "peak force, N",
)
"""Heads of the table of attempts."""

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #f7f7f8;
  max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2, h3 { line-height: 1.2; }
section { background: #fff; border: 1px solid #ddd; border-radius: 6px; padding: 1rem;
  margin: 1rem 0; }
.reached { color: #1a7f37; } .missed { color: #b42318; }
.stage { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); gap: 1rem; }
.stage img { width: 100%; }
.scene { min-height: 24rem; background: #f7f7fa; border: 1px solid #ddd; position: relative; }
.scene iframe { border: 0; width: 100%; height: 100%; position: absolute; inset: 0; }
.scene button { position: absolute; inset: 0; margin: auto; width: 11rem; height: 3rem;
  font: inherit; cursor: pointer; }
.numbers { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.9rem; }
th, td { padding: 0.2rem 0.8rem 0.2rem 0; text-align: right; border-bottom: 1px solid #eee; }
footer { color: #666; font-size: 0.9rem; }
@media (max-width: 50rem) { .stage { grid-template-columns: 1fr; } }
"""

# A recording begins when it is asked for: many at a time would be too much for a browser.
_SCRIPT = f"""
const unpack = {UNPACK};
async function play(scene) {{
  const frame = document.createElement("iframe");
  frame.title = scene.dataset.title;
  scene.replaceChildren(frame);
  frame.srcdoc = await unpack(document.getElementById(scene.dataset.recording).textContent);
}}
for (const scene of document.querySelectorAll(".scene"))
  scene.querySelector("button").addEventListener("click", () => play(scene));
const asked = location.hash && document.getElementById(location.hash.slice(1));
if (asked) play(asked.querySelector(".scene"));
"""


def make_page(exhibits: Sequence[Exhibit], method: str) -> str:
    """Returns the page; opened at `#<category>-<environment>` it plays that recording at once.

    Args:
        exhibits: What to show, in this order.
        method: Strategy that chose the starts.
    """
    versions = sorted({exhibit.attempts[0].record.drake_version for exhibit in exhibits})
    parts = [
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>Reaches into clutter</title>\n<style>{_STYLE}</style>\n</head>\n<body>",
        "<h1>Reaches into clutter</h1>",
        f"<p>Start poses selected by {html.escape(label(method))} in environments that are in no"
        " experience library: for each category the first environments, in their order, in which"
        " the goal was reached, and the first in which it was not. Each row is one reach.</p>",
    ]
    for category in dict.fromkeys(exhibit.scenario.category for exhibit in exhibits):
        parts.append(f"<h2>{html.escape(category)}</h2>")
        parts += [_section(e) for e in exhibits if e.scenario.category == category]
    parts += [
        f"<footer>Made by lic_drake {lic_drake.__version__} with Drake"
        f" {html.escape(', '.join(versions))}; the page needs no network.</footer>",
        f"<script>{_SCRIPT}</script>\n</body>\n</html>\n",
    ]
    return "\n".join(parts)


def numbers_of(number: int, attempt: Attempt) -> dict[str, float | int | str | None]:
    """Returns the figures of an attempt, None where nothing was measured or estimated.

    Args:
        number: Its number, from 1.
        attempt: The attempt.
    """
    chosen, record = attempt.selection, attempt.record
    values = {
        "start_y_m": float(chosen.start.x0[1]),
        "start_phi_deg": float(np.rad2deg(chosen.start.x0[2])),
        "base_y_m": float(chosen.start.b0[1]),
        "estimated_success": chosen.probability,
        "outcome": record.outcome,
        "duration_s": record.duration_s,
        "min_distance_m": record.min_distance,
        "peak_force_N": record.peak_force,
    }
    unmeasured = [k for k, v in values.items() if isinstance(v, float) and math.isnan(v)]
    return {"attempt": number, **values, **dict.fromkeys(unmeasured)}


def _section(exhibit: Exhibit) -> str:
    """Returns a trial's part of the page."""
    name = html.escape(f"{exhibit.scenario.category}-{exhibit.environment}", quote=True)
    word, kind = ("reached", "reached") if exhibit.success else ("not reached", "missed")
    x, y, _ = exhibit.p_WG
    still = base64.b64encode(exhibit.still).decode("ascii")
    rows = "\n".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in _cells(number, attempt))}</tr>"
        for number, attempt in enumerate(exhibit.attempts, start=1)
    )
    return f"""<section id="{name}">
<h3>Environment {exhibit.environment}, goal ({x:.3f}, {y:.3f}) m:
<span class="{kind}">{word}</span></h3>
<div class="stage">
<img alt="{name} from above" src="data:image/png;base64,{still}">
<div class="scene" data-recording="{name}-recording" data-title="{name}">
<button>Play the recording</button></div>
</div>
<div class="numbers"><table>
<tr>{"".join(f"<th>{head}</th>" for head in HEADS)}</tr>
{rows}
</table></div>
<p><small>Scenario {exhibit.scenario.digest}, seed stream {STREAM}.</small></p>
<script type="text/plain" id="{name}-recording">{pack(exhibit.recording)}</script>
</section>"""


def _cells(number: int, attempt: Attempt) -> list[str]:
    values = numbers_of(number, attempt)

    def show(key: str, digits: int, scale: float = 1.0) -> str:
        value = values[key]
        return f"{scale * value:.{digits}f}" if isinstance(value, float) else "–"

    return [
        str(number),
        show("start_y_m", 3),
        show("start_phi_deg", 1),
        show("base_y_m", 3),
        show("estimated_success", 0, 100.0),
        attempt.record.outcome,
        show("duration_s", 1),
        show("min_distance_m", 0, 1000.0),
        show("peak_force_N", 1),
    ]
