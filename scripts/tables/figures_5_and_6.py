"""Draws Figs. 5 and 6: two attempts of LIC in time, and what LIC-1 and LIC-2 made of the starts.

Takes the first recorded trial whose first attempt failed and whose second succeeded.

python scripts/tables/figures_5_and_6.py
"""

from lic_drake.evaluate.trial import run_trial
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.paths import shipped_library
from lic_drake.select.lic import LicSelector
from lic_drake.select.registry import make_selector
from lic_drake.show.density import densities_figure
from lic_drake.show.figures import save_figure
from lic_drake.show.views import snapshots_figure
from lic_drake.starts import line_starts
from scripts.common import add_results, load_trials, make_parser, run_script


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--category", default="cylinder-clutter")
    parser.add_argument("--method", default="gp")
    add_results(parser)
    args = parser.parse_args()
    trials = load_trials(args.results, args.category).trials(args.method)
    library = ExperienceLibrary(shipped_library(args.category))
    scenario = library.scenario()
    environment, goal = next(
        pair for pair, rows in trials.items() if len(rows) == 2 and rows[1].success
    )
    p_WG = scenario.sample_goal("evaluation", environment, goal)
    selector = make_selector(args.method, library.columns())
    if not isinstance(selector, LicSelector):
        parser.error(f"the figures show what LIC estimates; {args.method!r} estimates nothing")
    attempts = run_trial(scenario, selector, "evaluation", environment, p_WG, attempts=2)
    starts = line_starts(scenario, scenario.sample_instance("evaluation", environment))
    folder = args.results / "figures"
    folder.mkdir(parents=True, exist_ok=True)
    save_figure(snapshots_figure(attempts), folder / f"figure_5_{args.category}.png")
    density = densities_figure(selector, starts, attempts)
    save_figure(density, folder / f"figure_6_{args.category}.png")


if __name__ == "__main__":
    run_script(main)
