"""Times the same reaches in Drake and in MuJoCo, and compares how they end.

Arm, clutter, friction, stiffness, tactile maths, controller and stop rules are the same, only the
physics differs. The engines take turns at every reach; figures are medians over the reaches. MuJoCo
comes with the extra `bench`. On a quiet machine:

    python scripts/mujoco/run.py
"""

import json
import platform
import time
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from threadpoolctl import threadpool_limits

from lic_drake.reach.scenario import load_scenario
from scripts.common import RESULTS, make_parser, run_script, write_report
from scripts.mujoco.engines import Engine
from scripts.mujoco.growth import cylinders_table, draw_requests, taxels_table, workers_table
from scripts.mujoco.mujoco_scene import MujocoConfig
from scripts.mujoco.tables import engines_table, pairs_table
from scripts.mujoco.timing import time_paired

CLOCKS = {"wall": time.perf_counter, "cpu": time.process_time}

LEGEND = """\
Drake {drake}, MuJoCo {mujoco}, Python {python}; {requests}.
Costs are medians over the reaches, in seconds of {clock} time; ratios are medians of the reaches'
own ratios, with quartiles.

- awake: all movable objects are simulated all the time; otherwise both engines let them sleep
- stepping: the engine alone, without sensor, controller and the rest of our Python
- sensor: contact forces at the control instants (by the engine) and taxels (by our Python)
- set-up: what the first reach of an environment costs besides
"""


def make_engines(step_ms: float) -> tuple[list[Engine], list[tuple[str, str]]]:
    """Returns the engines, Drake and MuJoCo in turn, and the pairs to compare."""
    mujoco = [
        Engine(name=f"MuJoCo, {ms:g} ms", mujoco=MujocoConfig(time_step_s=1e-3 * ms))
        for ms in (step_ms, 1.0, 2.0, 10.0)
    ]
    awake = MujocoConfig(time_step_s=1e-3 * step_ms, sleep=False)
    mujoco_awake = Engine(name=f"MuJoCo, {step_ms:g} ms, awake", mujoco=awake)
    drake = Engine(name="Drake")
    drake_awake = Engine(name="Drake, awake", sleep=False)
    same_step = Engine(name=f"Drake, {step_ms:g} ms", time_step_s=1e-3 * step_ms)
    same_awake = Engine(
        name=f"Drake, {step_ms:g} ms, awake", time_step_s=1e-3 * step_ms, sleep=False
    )
    engines = [drake, mujoco[0], same_step, mujoco[1], drake_awake, mujoco_awake, same_awake]
    pairs = [
        (drake, mujoco[0]),
        (drake, mujoco_awake),
        (same_step, mujoco[0]),
        (drake_awake, mujoco_awake),
        (same_awake, mujoco_awake),
        (drake, same_step),
        (drake, drake_awake),
        (mujoco[0], mujoco_awake),
        *((mujoco[1], other) for other in (mujoco[2], mujoco[0], mujoco[3])),
    ]
    return engines + mujoco[2:], [(a.name, b.name) for a, b in pairs]


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--scenario", default="cylinder-clutter", help="name or YAML file")
    parser.add_argument("--reaches", type=int, default=30)
    parser.add_argument("--stream", default="calibration", help="seed stream of the environments")
    parser.add_argument("--environments", type=int, default=8)
    parser.add_argument("--goals", type=int, default=5, help="random goals in each environment")
    parser.add_argument("--step-ms", type=float, default=5.0, help="MuJoCo's step")
    parser.add_argument("--clock", choices=CLOCKS, default="wall", help="cpu: for a busy machine")
    parser.add_argument("--growth-reaches", type=int, default=6, help="for each line; 0 for none")
    parser.add_argument("--cylinders", type=int, nargs="+", default=[0, 20, 40, 80, 160, 320])
    parser.add_argument("--taxels", type=int, nargs="+", default=[50, 100, 200, 400], help="per m")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--out", type=Path, default=RESULTS / "peers")
    args = parser.parse_args()

    scenario = load_scenario(args.scenario)
    requests = draw_requests(scenario, args.stream, args.environments, args.goals)[: args.reaches]
    engines, pairs = make_engines(args.step_ms)
    clock = CLOCKS[args.clock]
    began = time.perf_counter()

    def say(line: str) -> None:
        print(f"{time.perf_counter() - began:5.0f} s {line}", flush=True)

    with threadpool_limits(1):
        rows = time_paired(scenario, requests, engines, clock, say)
        tables = {
            "Engines": engines_table(rows, [engine.name for engine in engines]),
            "Pairs": pairs_table(rows, pairs),
        }
        if args.growth_reaches:
            two, few = engines[:2], requests[: args.growth_reaches]
            tables["Cylinders"] = cylinders_table(
                scenario, args.stream, args.cylinders, args.growth_reaches, two, clock, say
            )
            tables["Taxels"] = taxels_table(scenario, few, args.taxels, two, clock, say)
            tables["Workers"] = workers_table(scenario, requests, args.workers, two, say)
    step_ms = 1e3 * scenario.scene.time_step_s
    drake = f"{step_ms:g} ms" if step_ms else f"CENIC, {1e3 * scenario.scene.cenic_max_step_s:g} ms"
    about = LEGEND.format(
        drake=f"{version('drake')} ({drake} where nothing else is said)",
        mujoco=version("mujoco"),
        python=platform.python_version(),
        requests=f"{len(requests)} reaches of {args.stream} environments in {args.scenario}",
        clock=args.clock,
    )
    text = about + "".join(f"\n## {title}\n\n{table}" for title, table in tables.items())
    args.out.mkdir(parents=True, exist_ok=True)
    content = {"about": about, "scenario": scenario.digest, "reaches": [asdict(r) for r in rows]}
    (args.out / "peers.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    write_report(args.out / "peers.md", text)


if __name__ == "__main__":
    run_script(main)
