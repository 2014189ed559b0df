"""Interrupts a two-process collection as Ctrl-C would, resumes it, and looks for lost reaches.

Usage: interrupted_collection.py FOLDER; works in an existing folder, with the `lic` command of the
running interpreter. The same collection is also made without an interruption, to compare with.
"""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq

LIC = str(Path(sys.executable).with_name("lic"))
COLLECTION = (
    *("--scenario", "cylinder-clutter", "--environments", "5", "--max-goals", "3"),
    *("--max-starts", "4", "--workers", "2"),
)
NUM_REACHES = 5 * 3 * 4
PATIENCE_S = 120.0

Row = dict[str, Any]


def run_lic(*arguments: str, status: int = 0) -> str:
    """Runs `lic` to its end and returns what it printed; another exit status ends this script."""
    result = subprocess.run([LIC, *arguments], stdout=subprocess.PIPE, text=True)
    if result.returncode != status:
        sys.exit(f"lic {' '.join(arguments)} ended with status {result.returncode}")
    return result.stdout


def read_rows(library: Path) -> list[Row]:
    """Reads the finished reaches from a library's files, without lic_drake."""
    rows: list[Row] = []
    for shard in sorted(library.rglob("*.parquet")):
        rows += pq.ParquetFile(shard).read().to_pylist()
    return rows


def collect_and_interrupt(library: Path) -> None:
    """Sends SIGINT to the whole process group once the first environment is on disk."""
    process = subprocess.Popen(
        [LIC, "collect", str(library), *COLLECTION],
        start_new_session=True,
        # A shell that runs this in the background may have made SIGINT ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        give_up = time.monotonic() + PATIENCE_S
        while not (library.is_dir() and read_rows(library)):
            if process.poll() is not None or time.monotonic() > give_up:
                sys.exit("the collection wrote no reach before it ended or before patience did")
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        status = process.wait(PATIENCE_S)
        print(f"interrupted; lic collect ended with status {status}")
        if status == 0:
            sys.exit("an interrupted collection must not report success")
        for _ in range(100):
            try:
                os.killpg(process.pid, 0)
            except ProcessLookupError:
                return
            time.sleep(0.1)
        sys.exit("a worker process outlives the interrupted collection")
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)


def comparable(rows: list[Row]) -> dict[str, str]:
    """Returns key -> everything else that a reach's request decides (NaN compares as text)."""
    return {
        row["key"]: repr(sorted((k, v) for k, v in row.items() if k != "wall_time_s"))
        for row in rows
    }


def main() -> None:
    """Runs the comparison and prints one line a step."""
    folder = Path(sys.argv[1])
    whole, cut = folder / "whole", folder / "cut"
    run_lic("collect", str(whole), *COLLECTION)

    collect_and_interrupt(cut)
    before = read_rows(cut)
    print(f"{len(before)} of {NUM_REACHES} reaches were on disk")
    if len(before) >= NUM_REACHES:
        sys.exit("the collection was too fast to be interrupted; make it larger")
    # Status 1: reaches are missing.
    report = json.loads(run_lic("experience", "check", str(cut), "--json", status=1))
    if report["damaged"] or report["duplicates"] or report["reaches"] != len(before):
        sys.exit(f"the interrupted library is unsound: {report}")

    run_lic("collect", str(cut), *COLLECTION)
    after = read_rows(cut)
    run_lic("experience", "check", str(cut))
    counted = json.loads(run_lic("experience", "info", str(cut), "--json"))["reaches"]

    keys = [row["key"] for row in after]
    if not len(keys) == len(set(keys)) == counted == NUM_REACHES:
        sys.exit(f"{NUM_REACHES} reaches asked for, {len(keys)} rows, {len(set(keys))} different")
    # A reach that was simulated a second time has another wall time.
    wall_time_s = {row["key"]: row["wall_time_s"] for row in after}
    again = [row["key"] for row in before if wall_time_s.get(row["key"]) != row["wall_time_s"]]
    if again:
        sys.exit(f"reaches from before the interruption were lost or made again: {again}")
    if comparable(after) != comparable(read_rows(whole)):
        sys.exit("the resumed library differs from the one that was not interrupted")
    print(f"resumed: {NUM_REACHES} reaches, none lost, none twice, all as without interruption")


if __name__ == "__main__":
    main()
