"""Bad input of every kind: one clear line, exit code 2, and no work before it is found."""

import os
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support import six_joint_arm
from support.fake_reach import fill_library

from lic_drake.cli.main import main
from lic_drake.kept import VARIABLE

PLAIN, SPHERES = "cylinder-clutter", "sphere-aperture-clutter"
CHECK, TRAIN = "robot check ROBOT", "train NEW --minutes 1 --robot ROBOT"
HAND = "hand_joint: {stiffness: 10.0, damping: 0.5, home_deg: 0.0}"
GOAL = "select --goal 0.6 0.1 --library LIBRARY --method knn"


def robot(
    old: str, new: str, said: str, command: str = CHECK, model: tuple[str, str] = ("", "")
) -> Any:
    """A robot file, or its model, with one text replaced by another."""

    def prepare(folder: Path) -> None:
        six_joint_arm.write(folder, old, new, model)

    return pytest.param(prepare, command, said, id=f"{new or model[1]}")


def file(name: str, content: bytes, said: str, command: str) -> Any:
    """A file of that name instead of one that is wanted; without content a folder."""

    def prepare(folder: Path) -> None:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content) if content else path.mkdir()

    return pytest.param(prepare, command, said, id=f"{command} with {name}")


def plain(command: str, said: str) -> Any:
    return pytest.param(lambda folder: None, command, said, id=command)


def library(damage: Callable[[Path], object], said: str, command: str = GOAL) -> Any:
    """A library whose second shard, or the whole of it, is damaged."""

    def prepare(folder: Path) -> None:
        damage(folder / "library" / "training-000001.parquet")

    return pytest.param(prepare, command, said, id=f"{command}: {said}")


def rewritten(change: Callable[[pa.Table], pa.Table]) -> Callable[[Path], None]:
    def damage(shard: Path) -> None:
        for path in shard.parent.glob("*.parquet"):
            pq.write_table(change(pq.read_table(path)), path)

    return damage


def header(name: str, value: bytes) -> Callable[[Path], None]:
    key = f"lic_drake.{name}".encode()
    return rewritten(
        lambda rows: rows.replace_schema_metadata({**rows.schema.metadata, key: value})
    )


def request(old: str, new: str) -> Callable[[Path], None]:
    def damage(shard: Path) -> None:
        path = shard.with_name("_collection.yaml")
        path.write_text(path.read_text().replace(old, new))

    return damage


def truncated(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


def swapped_for_a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def failed(values: str, said: str) -> Any:
    return plain(f"{GOAL} --failed '{{{values}}}'", f"--failed{said}")


ROBOTS = [
    robot("frame: column", "frame: column, color: red", "base: color cannot be red (The fields"),
    robot(HAND, "hand_joint: 3", "joints: hand_joint cannot be 3 (it must be a mapping)"),
    robot(HAND, HAND.replace("0.5", "-0.5"), "hand_joint: needs a positive stiffness"),
    robot(HAND, HAND.replace("10.0", ".inf"), "hand_joint: stiffness must be finite, got inf"),
    robot(HAND, HAND.replace("deg: 0.0", "deg: .nan"), "home_deg must be finite, got nan"),
    robot(HAND, HAND.replace("deg: 0.0", "deg: 400"), "hand_joint is beyond its limits in the ho"),
    robot(HAND, "hand_joint: {held: 99}", "held must be within its limits, from -2.5 to 2.5, got"),
    robot("height_range_m: [0.0, 0.4]", "height_range_m: 0.4", "height_range_m cannot be 0.4"),
    robot("[0.0, 0.4]", "[0.0, .inf]", "height_range_m must be a finite number, got [0.0, inf]"),
    robot(
        "carriage: add",
        "carriage: [turret_joint, roll_joint, hand_joint]",
        "carriage: joint 'turret_joint' turns; name one that slides, or add",
    ),
    robot("skin_links: all", "skin_links: hand", "skin_links must be all or a list, got 'hand'"),
    robot("[[0.03, 0.0, 0.0], [0.13,", "[[.inf, 0.0, 0.0], [0.13,", "that of 'hand' needs ends"),
    robot("xyz: [0.16,", "xyz: [.nan,", "xyz must be 3 finite numbers, got [nan, 0.0, 0.0]"),
    robot("carriage: add", "mpc: {speed: 3}", "mpc: speed cannot be 3.0 (The fields ['speed']"),
    robot("carriage: add", "mpc: {rate_hz: -3}", "mpc: rate_hz must be from 1 to 1000, got -3"),
    robot("model: six_joint_arm.urdf", "model: [a]", "model cannot be ['a']"),
    robot("arm.urdf", "arm.yaml", "six_joint_arm.yaml is no URDF or SDF file; give its path"),
    robot("", "", "(pos_lower", model=('lower="-2.5" upper="2.5"', 'lower="2.5" upper="-2.5"')),
    robot("", "", "link named 'no_column'", model=('parent link="', 'parent link="no_')),
    robot("stiffness: 60.0", "stiffness: 6000.0", "6000 Nm/rad, is too stiff for a", TRAIN),
    robot("[0.0, 0.4]", "[0.4, 0.0]", "height_range_m must be [least, most], got [0.4,", TRAIN),
    file("six_joint_arm.yaml", b"- a\n", "must be a YAML mapping, found list", CHECK),
    file("six_joint_arm.yaml", "# ä".encode("latin-1"), "not YAML: unacceptable character", CHECK),
    file("six_joint_arm.yaml", b" " * 1_000_001, "YAML of 1000001 bytes; at most 1000000", CHECK),
    file("six_joint_arm.yaml", b"!!python/tuple [a]", "could not determine a constructor", CHECK),
    file("six_joint_arm.yaml", b"", "or give a .yaml path", CHECK),
    file("new", b"a file", "cannot write into", "robot check pr2 --out NEW"),
    file("new", b"a file", "cannot create the folder", "train NEW --minutes 1"),
    plain(f"train NEW --minutes 1 --robot pr2 --category {PLAIN}", "pr2 is an arm in space;"),
    plain("train NEW --minutes 1 --robot iiwa14 --category passage-clutter", "is clutter in the"),
    plain("train NEW --minutes 1 --set [1]", "--set: must be a YAML mapping, found list"),
    plain("train NEW --minutes 0", "--minutes: needs a whole number of 1 or more, got '0'"),
    plain("train NEW", "one of the arguments --minutes --reaches is required"),
]
CHANGED = header("scenario", b"{category: cylinder-clutter, robot: planar-arm}")
LIBRARIES = [
    library(truncated, "is damaged or not a Parquet file; if it belongs to a library, delete it"),
    library(truncated, "training-000001.parquet is damaged", "explore LIBRARY"),
    library(swapped_for_a_folder, "is damaged or not a Par", "demo --library LIBRARY"),
    library(
        lambda shard: pq.write_table(pa.table({"a": [1]}), shard),
        "is not part of an experience library",
        "gallery NEW --library LIBRARY",
    ),
    library(rewritten(lambda rows: rows.drop_columns(["success"])), "or other columns; this lic"),
    library(header("schema_version", b"99"), "has schema version 99", "replay LIBRARY 0"),
    library(header("scenario", b"- a"), "must be a YAML mapping", "explore LIBRARY"),
    library(
        header("scenario", b"{a: ["), "not YAML: while parsing", "gallery NEW --library LIBRARY"
    ),
    library(header("scenario", b"\xff"), "damaged or not a Parquet file", "replay LIBRARY 0"),
    library(CHANGED, "but its reaches have", "evaluate NEW --library LIBRARY"),
    library(rewritten(lambda rows: rows.slice(0, 0)), "holds no reaches yet; add some with: lic"),
    library(rewritten(lambda rows: rows.slice(0, 0)), "holds no reaches", "replay LIBRARY 0"),
    library(rewritten(lambda rows: rows.slice(0, 0)), "holds no", "demo --library LIBRARY"),
    library(request("environments: 3", "environments: many"), "got many)", "collect LIBRARY"),
    library(request("stream:", "streams:"), "argument 'streams'); restore it", "collect LIBRARY"),
    library(request("scenario_digest:", "digest:"), "restore it, or", "experience check LIBRARY"),
    file("library/choices/trials.parquet", b"junk", "delete it and evaluate again", GOAL),
    file("new/trials.parquet", b"junk", "delete it and evaluate again", "evaluate NEW"),
    plain("replay LIBRARY 36", "has rows 0 to 35, got 36"),
    plain("replay LIBRARY -1", "argument ROW: needs a whole number of 0 or more, got '-1'"),
]
SELECT = [
    plain("select --goal 0.6 0.1 0.2", "is 2 numbers in metres, got 3: --goal 0.6 0.1 0.2"),
    plain("select --goal nan 0.1", "a goal is three finite numbers in metres, got [nan, 0.1, 0.0]"),
    plain("select", "is 2 numbers in metres, got 0: --goal"),
    plain("select --goal a 0.1", "argument --goal: invalid float value: 'a'"),
    plain(f"{GOAL} --least nan", "--least must be from 0 to 1, got nan"),
    plain(f"{GOAL} --least -0.1", "--least must be from 0 to 1, got -0.1"),
    plain(f"{GOAL} --least 0.2", "has no 30 choices of knn for attempt 1"),
    plain(f"{GOAL} --seed 4294967296", "seed indices must be from 0 to 2^32 - 1, got"),
    plain(f"{GOAL} --failed NEW", "--failed: cannot read"),
    failed("start_y: .nan, start_phi: 0.5", ": start_y must be a number from -1e+06 to 1e+06"),
    failed("start_y: true, start_phi: 0.5", ": start_y must be a number from -1e+06 to 1e+06"),
    failed('start_y: "0,1", start_phi: 0.5', ": start_y must be a number"),
    failed("start_y: 0.1, start_phi: 60", ": start_phi must be a number from -3.1416 to 3.1416"),
    failed("final_x: .inf, start_y: 0.1", ": final_x must be a number from -1e+06 to 1e+06"),
    failed(
        "start_y: 0.1, start_phi: 0.5, category: passage-clutter",
        " is a reach of passage-clutter, but the library is of cylinder-clutter; choose another",
    ),
]
EVALUATE = "evaluate NEW --library LIBRARY --methods knn"
OTHERS = [
    plain(f"{EVALUATE} --scenario {SPHERES}", "is for planar-arm, but pr2 is evaluated; choose"),
    plain(f"{EVALUATE} knn", "method knn is there 2 times; keep one"),
    plain(f"{EVALUATE} --environments 4294967296", "environments must be from 1 to 1000000, got 4"),
    plain(f"{EVALUATE} --attempts 0", "argument --attempts: needs a whole number of 1 or more"),
    plain(f"{EVALUATE} --cameras none.yaml", "no cameras 'none.yaml'; shipped cameras: foliage"),
    plain("evaluate LIBRARY --methods cost", "is a library itself; evaluate into another folder"),
    plain("collect NEW --first -1", "first_environment must be from 0 to 2147483647, got -1"),
    plain("collect NEW --max-starts 0", "max_starts must be from 1 to 1000000, got 0"),
    plain("collect NEW --share a/b", "k from 1 to n, for instance 3/20, got a/b"),
    plain("collect NEW --set '{robot: pr2}'", "pr2 is an arm in space; choose another"),
    plain("collect NEW --set '{mpc: {rate_hz: fast}}'", "mpc: rate_hz cannot be fast"),
    plain("collect NEW --set '{category: passage-clutter}'", "clutter: num_movable cannot be"),
    plain("collect NEW --set '{scene: {taxels_per_m: 1e9}}'", "taxels_per_m must be from 1"),
    plain("collect NEW --set '{task: {start_line: {x_m: 5.0}}}'", "change task.start_line"),
    plain(f"demo --robot pr2 --category {PLAIN}", "pr2 is an arm in space; choose another"),
    plain("demo --robot planar-arm --category foliage-aperture-clutter", "is an arm in the plane"),
    plain(f"demo --category {SPHERES} --library LIBRARY", f"not --category {SPHERES}; choose"),
    plain("demo --category foliage-aperture-clutter --library LIBRARY", "is clutter in space"),
    robot("frame: column", "frame: column", "six_joint_arm.yaml in", "demo --robot ROBOT"),
    plain("demo --seed 4294967296", "seed indices must be from 0 to 2^32 - 1, got"),
    plain("demo --robot pr2 --set '{clutter: {num_blocked: 20}}'", "from 0 to 19, got 20"),
    plain("gallery NEW --each 0", "argument --each: needs a whole number of 1 or more, got '0'"),
    plain("gallery NEW --seed 4294967296 --library LIBRARY", "from 0 to 2^32 - 1, got"),
    file("new/index.html", b"", "it is a folder; delete it or choose another", "gallery NEW"),
    plain("explore --port 80", "argument --port: needs a whole number of 1024 or more, got '80'"),
    plain("explore --method gp>knn", "--method gp>knn is two strategies; choose one, gp or knn"),
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return fill_library(tmp_path_factory.mktemp("whole") / "library")


@pytest.fixture
def _no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither fits nor reaches."""

    def work(*args: Any, **values: Any) -> None:
        raise AssertionError("this is work")

    monkeypatch.setattr("lic_drake.reach.environment.Environment.reach", work)
    monkeypatch.setattr("lic_drake.select.registry.fit_model", work)


@pytest.mark.usefixtures("_here", "_no_work")
@pytest.mark.parametrize(("prepare", "command", "said"), ROBOTS + LIBRARIES + SELECT + OTHERS)
def test_it_is_refused_in_one_line_before_any_work(
    prepare: Callable[[Path], None],
    command: str,
    said: str,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)  # Where some commands write by default.
    shutil.copytree(whole, tmp_path / "library")
    prepare(tmp_path)
    names = {"ROBOT": "six_joint_arm.yaml", "NEW": "new", "LIBRARY": "library"}
    try:
        code = main([str(tmp_path / names[w]) if w in names else w for w in shlex.split(command)])
    except SystemExit as end:  # As argparse ends.
        assert end.code == 2
        code = 2
    output, error = capsys.readouterr()
    assert (code, output) == (2, "")
    *before, line = error.splitlines()
    assert line.startswith("lic") and ": error: " in line and said in line
    assert not before or before[0].startswith("usage: lic ")


def other_arrays(path: Path) -> None:
    np.savez(path, kept_as=path.name, bandwidth=np.ones(9))


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (truncated, "lic: ignored the kept fit"),
        (other_arrays, "bandwidth has another shape, or is not finite"),
        (swapped_for_a_folder, "lic: cannot keep the fit in"),
        (lambda path: path.write_text("kept"), "lic: ignored the kept fit"),
    ],
)
def test_a_damaged_kept_fit_costs_a_line_and_a_fit(
    damage: Callable[[Path], object],
    said: str,
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    command = ["select", "--goal", "0.6", "0.1", "--library", str(whole), "--method", "knn1"]
    assert main(command) == 0
    expected = capsys.readouterr().out.partition("seconds")[0]
    (path,) = tmp_path.iterdir()
    damage(path)
    assert main(command) == 0
    output, error = capsys.readouterr()
    assert output.partition("seconds")[0] == expected
    assert said in error and "Traceback" not in error


@pytest.mark.parametrize("place", ["/dev/null", "/proc/none", os.devnull + "/below"])
def test_a_cache_that_cannot_be_written_costs_a_line(
    place: str,
    whole: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setenv(VARIABLE, place)
    command = ["select", "--goal", "0.6", "0.1", "--library", str(whole), "--method", "knn1"]
    assert main(command) == 0
    error = capsys.readouterr().err
    assert f"lic: cannot keep the fit in {place}: " in error and "Traceback" not in error
