"""The whole sequence of looks and reaches as one page that plays offline (paper Fig. 2)."""

import base64
import html
from collections.abc import Mapping, Sequence
from pathlib import Path

from lic_drake.evaluate.trial import Attempt
from lic_drake.perception.observer import Observer
from lic_drake.show.embed import UNPACK, pack, read_page

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 76rem; margin: 1.5rem auto;
  padding: 0 1rem; }
img { width: 100%; } iframe { border: 1px solid #ddd; width: 100%; height: 34rem; }
figure { margin: 1rem 0; } figcaption { color: #555; font-size: 0.9rem; }
"""


def make_sequence_page(
    observer: Observer, done: Sequence[Attempt], files: Mapping[str, Path]
) -> str:
    """Returns the page.

    Args:
        observer: What the robot saw.
        done: The attempts in their order.
        files: The recording ("recording"), the looks ("look 1" and so on) and, if there is one, the
            film of both cameras ("views").

    Raises:
        LicError: The recording cannot be read.
    """
    last = done[-1].record
    word = "reached" if observer.touches_ball(last) else "not reached"
    title = f"{observer.scenario.category}, environment {observer.environment}: {word}"
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        "<p>The robot looks, selects an aperture, a place for its base and a height for its torso,"
        " moves base, torso and arm in that order, and reaches. After a failure it looks and"
        " selects again. Arrows are contact forces.</p>",
        '<iframe id="recording" title="recording"></iframe>',
    ]
    if "views" in files:
        parts.append(
            _picture(files["views"], "image/webp", "The head camera and the external camera")
        )
    for number, attempt in enumerate(done, start=1):
        probability = attempt.selection.probability
        words = f"Look {number}: open apertures, passable probabilities and goal. Attempt {number}:"
        words += f" {attempt.record.outcome}"
        if probability is not None:
            words += f", estimated success {100.0 * probability:.0f} %"
        parts.append(_picture(files[f"look {number}"], "image/png", words + "."))
    packed = pack(read_page(files["recording"]))
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>lic_drake</title>'
        f"<style>{_STYLE}</style></head>\n<body>\n" + "\n".join(parts) + "\n"
        f"<script>({UNPACK})('{packed}')"
        ".then(page => document.getElementById('recording').srcdoc = page)</script>\n"
        "</body></html>\n"
    )


def _picture(path: Path, kind: str, words: str) -> str:
    data = base64.b64encode(path.read_bytes()).decode("ascii")
    caption = html.escape(words)
    return (
        f'<figure><img alt="{caption}" src="data:{kind};base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )
