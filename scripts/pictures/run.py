"""Makes the READMEs' pictures of demonstrations, and pictures.json beside them: what they show.

python scripts/pictures/run.py planar pr2 foliage
"""

import json
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from matplotlib.figure import Figure

from lic_drake.cli.main import main as lic
from lic_drake.errors import LicError
from lic_drake.experience.schema import write_atomically
from lic_drake.show.figures import save_figure
from scripts.common import RESULTS, make_parser, run_script

IMAGES, NUMBERS = RESULTS / "images", "pictures.json"

DEMOS = {
    "planar": ("lic demo", {"density.png": "density.png", "path.png": "path.png"}),
    "pr2": (
        "lic demo --robot pr2",
        {
            "pr2_apertures.png": "apertures.png",
            "pr2_path.png": "path.png",
            "pr2_middle.png": "attempt1_middle.png",
        },
    ),
    "foliage": (
        "lic demo --category foliage-aperture-clutter",
        {"foliage.webp": "film.webp"},
    ),
    "iiwa14": ("lic demo --robot iiwa14", {"iiwa14.png": "attempt2_end.png"}),
    "panda": ("lic demo --robot panda", {"panda.png": "attempt1_end.png"}),
}
"""Commands, and for each picture the file of the command's that it is a copy of."""


def run_demo(name: str, out: Path) -> dict[str, Any]:
    """Runs a command of `DEMOS`, which writes to a folder; returns what its pictures show.

    Estimates are rounded as on the demonstration's page; `pictures` has the titles, numbers and
    legends of each, none of a film.
    """
    command, pictures = DEMOS[name]
    printed: dict[str, list[str]] = {}

    def save(figure: Figure, path: Path, margins: bool = True) -> None:
        printed[path.name] = texts(figure)
        save_figure(figure, path, margins)

    with (
        patch("lic_drake.show.pictures.save_figure", save),
        patch("lic_drake.show.stills.save_figure", save),
    ):
        if lic([*command.split()[1:], "--out", str(out)]) != 0:
            raise LicError(f"`{command}` failed; see above")
    demo = json.loads((out / "demo.json").read_text(encoding="utf-8"))
    return {
        "command": command,
        "category": demo["attempts"][0]["record"]["category"],
        "seed": demo["seed"],
        "success": demo["success"],
        "attempts": [
            {
                "outcome": attempt["record"]["outcome"],
                "estimated_success": round(attempt["estimated_success"], 2),
            }
            for attempt in demo["attempts"]
        ],
        "pictures": {picture: printed.get(file, []) for picture, file in pictures.items()},
    }


def texts(figure: Figure) -> list[str]:
    """Returns titles, texts in the axes and legends of a figure."""
    found = []
    for ax in figure.axes:
        legend = ax.get_legend()
        shown = [ax.title, *ax.texts, *(legend.get_texts() if legend else [])]
        found += [text.get_text() for text in shown if text.get_text()]
    return found


def main() -> None:
    """Makes the pictures of some commands, and notes what they show."""
    parser = make_parser(__doc__)
    parser.add_argument("demos", nargs="+", choices=DEMOS)
    path = IMAGES / NUMBERS
    shown = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    for name in parser.parse_args().demos:
        with TemporaryDirectory() as folder:
            out = Path(folder)
            shown[name] = run_demo(name, out)
            for picture, file in DEMOS[name][1].items():
                shutil.copyfile(out / file, IMAGES / picture)
    content = json.dumps(shown, indent=2) + "\n"
    write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))


if __name__ == "__main__":
    run_script(main)
