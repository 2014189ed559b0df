"""Every reader meets files that nobody vouches for: a record, or one clear error, and nothing else.

Bad types, missing keys, NaN, huge values, other schemas, tricks in names and paths.
"""

import dataclasses
import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from fake_reach import fill_library, make_record, make_request
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from trial_rows import make_rows

from lic_drake.errors import LibraryError, LicError, ScenarioError
from lic_drake.evaluate.gallery import HELD_OUT_CALIBRATION, held_out_calibration_figure
from lic_drake.evaluate.learning import read_learning_curves
from lic_drake.evaluate.trials import SCHEMA as TRIALS
from lic_drake.evaluate.trials import TrialTable, read_trials, write_trials
from lic_drake.experience.grid import REQUEST_FILE, read_request, write_request
from lic_drake.experience.journal import read_journal
from lic_drake.experience.schema import make_header, read_table, to_records, to_table
from lic_drake.experience.store import ExperienceLibrary
from lic_drake.reach.scenario import load_scenario, parse_scenario
from lic_drake.yaml_text import parse_yaml

ANYTHING = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.sampled_from([10**400, -(2**63), 2**64, 1e308, -1e308, math.nan, math.inf])
    | st.floats()
    | st.text(max_size=8)
    | st.sampled_from(["../../x", "/etc/passwd", "a\x00b", "\ud800", "!!python/name:os.system"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=4,
)

BOMB = "a: &a [x, x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join([f'*{chr(97 + i)}'] * 20)}]\n" for i in range(15)
)

loosely = settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture])


def outcome(read: Callable[[], Any]) -> Any:
    """Returns what is read, or None after an error that is one clear line."""
    try:
        return read()
    except LicError as error:
        message = str(error)
        assert "\n" not in message
        assert 10 < len(message) < 5000
        return None


def put(data: Any, path: list[Any], value: Any) -> None:
    for key in path[:-1]:
        data = data[key]
    data[path[-1]] = value


def paths(data: Any, at: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """All places in nested data."""
    items = data.items() if isinstance(data, dict) else enumerate(data)
    found = []
    for key, value in items:
        found.append((*at, key))
        if isinstance(value, dict | list):
            found += paths(value, (*at, key))
    return found


@pytest.fixture(scope="module")
def request_text(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("request") / REQUEST_FILE
    write_request(make_request(), path)
    return path.read_text(encoding="utf-8")


def dump(data: Any) -> str | None:
    """YAML of any data; None where there is none."""
    try:
        return yaml.safe_dump(data)
    except (yaml.YAMLError, UnicodeEncodeError):
        return None


@loosely
@given(data=st.data())
def test_a_request_of_a_collection_is_read_or_refused(
    request_text: str, tmp_path: Path, data: st.DataObject
) -> None:
    content = yaml.safe_load(request_text)
    for _ in range(data.draw(st.integers(1, 2))):
        place = list(data.draw(st.sampled_from(paths(content))))
        put(content, place, data.draw(ANYTHING))
    text = dump(content)
    if text is None:
        return
    path = tmp_path / REQUEST_FILE
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    request = outcome(lambda: read_request(path))
    if request is not None:
        assert request.scenario.digest == content["scenario_digest"]


@loosely
@given(cut=st.integers(0, 5000), junk=st.binary(max_size=20))
def test_a_damaged_request_is_read_or_refused(
    request_text: str, tmp_path: Path, cut: int, junk: bytes
) -> None:
    path = tmp_path / REQUEST_FILE
    content = request_text.encode()
    cut %= len(content)
    path.write_bytes(content[:cut] + junk + content[cut + len(junk) :])
    outcome(lambda: read_request(path))


@pytest.mark.parametrize("missing", ["stream", "scenario", "environments", "scenario_digest"])
def test_a_request_without_a_key_is_refused(
    request_text: str, tmp_path: Path, missing: str
) -> None:
    content = yaml.safe_load(request_text)
    del content[missing]
    (tmp_path / REQUEST_FILE).write_text(yaml.safe_dump(content))
    with pytest.raises(LibraryError, match="not a collection request"):
        read_request(tmp_path / REQUEST_FILE)


HOSTILE = [
    BOMB + "category: *p\nrobot: planar-arm",
    "category: &x cylinder-clutter\nrobot: planar-arm\ntask: {y: *x}",
    "&a [*a]",
    "{category: cylinder-clutter, robot: planar-arm, <<: {task: 2001-99-99}}",
    "[" * 100_000,
    "{" * 5000 + "}" * 5000,
    "category: " + "9" * 5000,
    "category: !!python/object/apply:os.system ['touch {0}']\nrobot: planar-arm",
    "!!python/object/apply:pathlib.Path.touch [!!python/object/apply:pathlib.Path ['{0}']]",
    "!!python/module:os",
    "robot: !!binary =\ncategory: x",
    "\x00",
    "a: 2001-99-99",
]


@pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_yaml_is_refused_everywhere_and_does_nothing(
    text: str, request_text: str, tmp_path: Path
) -> None:
    touched = tmp_path / "touched"
    text = text.replace("{0}", str(touched))
    scenario = tmp_path / "hostile.yaml"
    scenario.write_text(text, encoding="utf-8")
    for read in (
        lambda: load_scenario(scenario),
        lambda: parse_scenario(text),
        lambda: load_scenario("cylinder-clutter", text),
        lambda: read_request(scenario),
    ):
        with pytest.raises(LicError) as caught:
            read()
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 5000
    library = tmp_path / "library"
    library.mkdir()
    header = dataclasses.replace(make_header(make_request().scenario), scenario=text)
    pq.write_table(to_table([], header), library / "x.parquet")
    with pytest.raises(LicError):
        ExperienceLibrary(library).scenario()
    assert not touched.exists()


def test_what_is_plain_yaml_is_read_as_by_the_safe_loader(request_text: str) -> None:
    assert parse_yaml(request_text) == yaml.safe_load(request_text)
    assert parse_yaml(b"[1, 2.5, true, null, 'x', {a: b}]") == [1, 2.5, True, None, "x", {"a": "b"}]


@pytest.mark.parametrize(
    "name", ["../scenarios/cylinder-clutter", "/etc/passwd", "..", "", "a/b", "a\x00b", "\ud800"]
)
def test_a_scenario_s_name_leads_nowhere_else(name: str) -> None:
    with pytest.raises(ScenarioError, match="shipped scenarios"):
        load_scenario(name)


@pytest.mark.parametrize(
    "name",
    ["", ".", "..", "../up", "/etc/x", "a/b", "a\\b", "_x", ".x", "a\x00", "a b", "é", "a\n"],
)
def test_a_shard_s_name_leads_nowhere_else(tmp_path: Path, name: str) -> None:
    library = ExperienceLibrary(tmp_path / "library")
    with pytest.raises(LibraryError, match="shard's name"):
        library.write_shard(name, [], make_request().scenario)
    assert not (tmp_path / "library").exists()


def journal_line() -> dict[str, Any]:
    record = make_record(make_request().reaches(0)[5])
    return json.loads(json.dumps(dataclasses.asdict(record)))


@loosely
@given(data=st.data())
def test_a_journal_gives_records_that_a_table_can_hold(tmp_path: Path, data: st.DataObject) -> None:
    line = journal_line()
    for _ in range(data.draw(st.integers(0, 2))):
        line[data.draw(st.sampled_from(sorted(line)))] = data.draw(ANYTHING)
    path = tmp_path / "_x.partial.jsonl"
    whole = json.dumps(journal_line()).encode() + b"\n"
    path.write_bytes(whole + json.dumps(line).encode() + b"\n" + whole)
    records, lost = read_journal(path)
    assert len(records) + lost == 3
    assert len(records) >= 2
    table = to_table(records, make_header(make_request().scenario))
    assert len(to_records(table)) == len(records)


@pytest.mark.parametrize("line", [b"[" * 100_000, b"\xff\xfe", b"{}", b"null", b'"x"', b"1e999"])
def test_a_strange_line_of_a_journal_costs_itself_only(tmp_path: Path, line: bytes) -> None:
    path = tmp_path / "_x.partial.jsonl"
    whole = json.dumps(journal_line()).encode() + b"\n"
    path.write_bytes(whole + line + b"\n" + whole)
    records, lost = read_journal(path)
    assert (len(records), lost) == (2, 1)


@pytest.fixture(scope="module")
def shard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    library = fill_library(tmp_path_factory.mktemp("library"))
    return sorted(library.glob("*.parquet"))[0]


def change(table: pa.Table, data: st.DataObject) -> pa.Table:
    """A table with a column less, more, renamed, doubled, of another type, or other metadata."""
    i = data.draw(st.integers(0, table.num_columns - 1))
    field, n = table.schema.field(i), table.num_rows
    other = data.draw(
        st.sampled_from(
            [
                pa.array([None] * n, pa.null()),
                pa.array(["x"] * n),
                pa.array([2**62] * n),
                pa.array([math.nan] * n),
                pa.array([[1.0]] * n),
                pa.array([b"\xff"] * n),
            ]
        )
    )
    kind = data.draw(st.sampled_from(["drop", "rename", "double", "retype", "metadata", "null"]))
    if kind == "drop":
        return table.drop_columns([field.name])
    if kind == "rename":
        return table.rename_columns(
            [name if name != field.name else data.draw(st.text()) for name in table.column_names]
        )
    if kind == "double":
        return table.append_column(field, table.column(i))
    if kind == "retype":
        return table.set_column(i, field.name, other)
    if kind == "null":
        return table.set_column(i, field.with_nullable(True), pa.array([None] * n, field.type))
    metadata = dict(table.schema.metadata)
    key = data.draw(st.sampled_from(sorted(metadata)))
    text = st.text().map(lambda t: t.encode("utf-8", "surrogatepass"))
    metadata[key] = data.draw(st.binary(max_size=10) | text | st.just(b"-1") | st.just(b"9" * 5000))
    return table.replace_schema_metadata(metadata)


@loosely
@given(data=st.data())
def test_a_library_file_of_another_kind_is_refused(shard: Path, data: st.DataObject) -> None:
    original = pq.read_table(shard)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.parquet"
        try:
            pq.write_table(change(original, data), path)
        except (UnicodeError, pa.ArrowException):
            return
        library = ExperienceLibrary(folder)
        rows = outcome(library.records)
        outcome(library.scenario)
        if rows is not None:
            assert len(rows) == original.num_rows


@loosely
@given(at=st.integers(0, 10**6), junk=st.binary(min_size=1, max_size=30))
def test_damage_in_a_library_file_is_noticed_or_harmless(
    shard: Path, tmp_path: Path, at: int, junk: bytes
) -> None:
    content = shard.read_bytes()
    at %= len(content)
    path = tmp_path / "x.parquet"
    path.write_bytes(content[:at] + junk + content[at + len(junk) :])
    rows = outcome(lambda: to_records(read_table(path)))
    if rows is not None:
        assert [row.key for row in rows] == [row.key for row in to_records(read_table(shard))]


def test_a_library_whose_scenario_was_edited_is_refused(tmp_path: Path) -> None:
    header = make_header(make_request().scenario)
    edited = dataclasses.replace(header, scenario=header.scenario.replace("40", "41"))
    pq.write_table(to_table([], edited), tmp_path / "x.parquet")
    with pytest.raises(LibraryError, match=f"{header.scenario_digest}.*edited"):
        ExperienceLibrary(tmp_path).scenario()


@loosely
@given(data=st.data())
def test_trials_of_another_kind_are_refused(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "trials.parquet"
    write_trials(path, make_rows("gp", ["1", "01", "00"]))
    try:
        pq.write_table(change(pq.read_table(path), data), path)
    except (UnicodeError, pa.ArrowException):
        return
    rows = outcome(lambda: read_trials(path))
    if rows is not None:
        assert [row.method for row in rows] == ["gp"] * 5


@loosely
@given(
    st.lists(
        st.tuples(st.integers(-2, 3), st.integers(-1, 2), st.integers(-1, 3), st.booleans()),
        max_size=6,
    )
)
def test_trials_in_any_order_are_a_table_or_refused(
    attempts: list[tuple[int, int, int, bool]],
) -> None:
    (row,) = make_rows("gp", ["1"])
    rows = [
        dataclasses.replace(row, environment=e, goal=g, attempt=a, success=s)
        for e, g, a, s in attempts
    ]
    outcome(lambda: TrialTable(rows))


def test_trials_have_the_schema_that_is_tested() -> None:
    assert {str(field.type) for field in TRIALS} == {"string", "int64", "double", "bool"}


@loosely
@given(
    content=st.binary(max_size=200)
    | st.text(max_size=200).map(lambda t: t.encode("utf-8", "replace"))
)
def test_tables_as_text_are_read_or_refused(tmp_path: Path, content: bytes) -> None:
    heads = (b"estimator,size,value,low,high\n", b"estimator,low,high,count,predicted,observed\n")
    curve, calibration = tmp_path / "curve.csv", tmp_path / HELD_OUT_CALIBRATION
    calibration.parent.mkdir(exist_ok=True)
    curve.write_bytes(heads[0] + content)
    calibration.write_bytes(heads[1] + content)
    outcome(lambda: read_learning_curves(curve))
    outcome(lambda: held_out_calibration_figure(tmp_path))


def test_a_field_without_end_is_one_clear_error(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("estimator,size,value,low,high\n" + "x" * 200_000)
    with pytest.raises(LibraryError, match="no learning curve"):
        read_learning_curves(path)
