"""What LIC gains over COST among cylinders if what the paper leaves open were otherwise.

    python scripts/sensitivity/run.py

For each variant of the scenario `lic collect` and `lic evaluate`, as for the shipped one, only less
of both: 3,024 reaches in 24 environments, then first attempts at 500 goals in environments of the
stream holdout.
"""

from pathlib import Path

from lic_drake.cli.main import main as lic
from lic_drake.errors import LicError
from lic_drake.evaluate.statistics import count, mcnemar, paired_difference
from lic_drake.evaluate.table import Table
from lic_drake.evaluate.trials import TrialTable, read_trials
from scripts.common import add_results, add_workers, make_parser, run_script, write_report

VARIANTS = {
    "as shipped": "{}",
    "controller haptic_mpc_2013": "{mpc: {preset: haptic_mpc_2013}}",
    "stuck: less than 5 mm in 3 s": "{stop: {stuck_distance_m: 0.005, stuck_time_s: 3.0}}",
    "skin a hundredth as stiff": "{scene: {contact: {skin_modulus_Pa: 1.0e+6}}}",
    "twice the friction, of bodies and ground": (
        "{scene: {ground_friction_N: 4.0, contact: {object_friction: 0.4}}}"
    ),
}
"""YAML over the shipped scenario, by what it says."""

LEARNING = ["--environments", "24", "--max-goals", "6"]
EVALUATION = ["--environments", "250", "--goals", "2", "--attempts", "1", "--stream", "holdout"]
METHODS = ["rnd", "cost", "gp"]


def compare(folder: Path, override: str, workers: int) -> TrialTable:
    """Returns the trials of a variant; those in the folder are not simulated again."""
    library, pool = str(folder / "library"), ["--workers", str(workers)]
    scenario = ["--scenario", "cylinder-clutter", "--set", override]
    for command in (
        ["collect", library, *scenario, *LEARNING, *pool],
        ["evaluate", str(folder), "--library", library, *EVALUATION, *pool, "--methods", *METHODS],
    ):
        if code := lic(command):
            raise LicError(f"lic {command[0]} ended with {code}")
    return TrialTable(read_trials(folder / "trials.parquet"))


def row(name: str, trials: TrialTable) -> tuple[str, ...]:
    """Returns a variant's cells: RND, COST, LIC, LIC - COST with its interval, McNemar's p."""
    won = [trials.success(method, 1) for method in METHODS]
    _, by_cost, lic_ = won
    gain = "{:.1f} ({:.1f}..{:.1f})".format(*(100.0 * x for x in paired_difference(lic_, by_cost)))
    rates = (f"{100.0 * count(success).rate:.1f}" for success in won)
    return (name, *rates, gain, f"{mcnemar(lic_, by_cost):.2g}")


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--reaches", type=Path, default=Path("out/sensitivity"), help="folder")
    add_results(parser)
    add_workers(parser)
    args = parser.parse_args()
    rows = []
    for i, (name, override) in enumerate(VARIANTS.items()):
        rows.append(row(name, compare(args.reaches / str(i), override, args.workers)))
        heading = ("variant", "RND", "COST", "LIC(GP)", "LIC - COST, points", "p")
        caption = "First attempts at 500 goals, %; intervals of 90 %."
        table = Table(caption=caption, heading=heading, rows=tuple(rows))
        write_report(args.results / "sensitivity.md", table.to_markdown())


if __name__ == "__main__":
    run_script(main)
