import json
import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

from lic_drake.experience.workers import Workers
from scripts.mujoco import run as benchmark_peers
from scripts.mujoco.tables import pairs_table
from scripts.mujoco.timing import Timing

SCENARIO = """
category: cylinder-clutter
robot: planar-arm
clutter: {num_movable: 4, num_fixed: 4}
stop: {timeout_s: 0.4}
"""


def timing(engine: str, reach: int, outcome: str, total_s: float) -> Timing:
    parts = {"stepping": 0.5 * total_s, "sensor": 0.2 * total_s, "mpc": 0.2 * total_s}
    return Timing(
        engine=engine,
        reach=reach,
        outcome=outcome,
        simulated_s=10.0,
        total_s=total_s,
        parts=parts,
        setup_s=0.05 if reach == 0 else None,
    )


ROWS = [
    timing("A", 0, "reached", 0.2),
    timing("B", 0, "reached", 0.1),
    timing("A", 1, "stuck", 0.9),
    timing("B", 1, "force", 0.3),
    timing("A", 2, "reached", 0.4),
    timing("B", 2, "stuck", 0.1),
]


def cells(table: str, line: int) -> list[str]:
    return [cell.strip() for cell in table.splitlines()[line].strip("|").split("|")]


def test_ratios_are_medians_of_the_reaches_own_ratios_and_outcomes_are_paired() -> None:
    table = pairs_table(ROWS, [("A", "B")])
    ratio = "3.00 (2.50..3.50)"  # 2, 3 and 4; the ratio of the medians is 4.
    counts = ["1", "1", "0", "1", "1 of 3"]
    assert cells(table, 2) == ["A", "B", ratio, ratio, *counts, "1.00"]


def test_the_script_writes_its_tables_and_every_reach(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = tmp_path / "small.yaml"
    scenario.write_text(SCENARIO)
    arguments = f"--scenario {scenario} --out {tmp_path} --reaches 1 --environments 1 --goals 1"
    arguments += " --growth-reaches 1 --cylinders 4 --taxels 50 --workers 1"
    monkeypatch.setattr(sys, "argv", ["run.py", *arguments.split()])
    monkeypatch.setattr("scripts.mujoco.growth.LocalWorkers", lambda count: Workers())
    benchmark_peers.main()
    text = (tmp_path / "peers.md").read_text()
    for title in ("Engines", "Pairs", "Cylinders", "Taxels", "Workers"):
        assert f"\n## {title}\n" in text
    engines = [engine.name for engine in benchmark_peers.make_engines(5.0)[0]]
    reaches = json.loads((tmp_path / "peers.json").read_text())["reaches"]
    assert [row["engine"] for row in reaches] == engines
    for row in reaches:
        assert 0.0 < sum(row["parts"].values()) < row["total_s"]
        assert min(row["parts"].values()) > 0.0
