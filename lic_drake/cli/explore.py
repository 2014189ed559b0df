"""`lic explore`: estimates and reaches live in a browser; `lic replay`: a row of a library."""

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

from lic_drake.cli.arguments import (
    DEFAULT_SCENARIO,
    Subparsers,
    add_command,
    quick_imports,
    whole_number,
)
from lic_drake.errors import LicError, remark
from lic_drake.paths import find_library, shipped_libraries, shipped_library

if TYPE_CHECKING:
    from pydrake.geometry import Meshcat

    from lic_drake.reach.scenario import Scenario
    from lic_drake.show.explore import Explorer

_PAUSE_S, _LAST_PORT = 0.05, 65535


def add_parser(subparsers: Subparsers) -> None:
    """Adds both subcommands to the command line."""
    explore = add_command(
        subparsers,
        "explore",
        run,
        "explore estimates and reaches live in a browser",
        "Sliders move the goal, change the environment and block apertures; the map of estimated"
        " success (yellow: likely, violet: unlikely) and the chosen start follow. Buttons reach,"
        " and go to another category. Prints the address; Ctrl-C ends it.",
        "lic explore sphere-aperture-clutter --port 7005",
        ["--method"],
    )
    explore.add_argument(
        "category",
        metavar="CATEGORY",
        nargs="?",
        default=DEFAULT_SCENARIO,
        help="shipped library, or folder of one, to learn from: cylinder-clutter, passage-clutter,"
        " cylinder-aperture-clutter, sphere-aperture-clutter or foliage-aperture-clutter"
        " (default: %(default)s)",
    )
    replay = add_command(
        subparsers,
        "replay",
        run_replay,
        "show a row of an experience library live in a browser",
        "Simulates its reach again and plays it with contact forces. Prints the address; Ctrl-C"
        " ends it.",
        "lic replay cylinder-clutter 17",
    )
    replay.add_argument(
        "library", metavar="LIBRARY", type=find_library, help="folder, file or name of the library"
    )
    replay.add_argument("row", metavar="ROW", type=whole_number(0), help="row, counted from 0")
    for command in (explore, replay):
        command.add_argument(
            "--port",
            metavar="N",
            type=whole_number(1024),
            help="port to listen on, at all of this machine's addresses (default: the first free"
            " one from 7000)",
        )


def run(args: argparse.Namespace) -> int:
    """Explores one category after the other until it is interrupted."""
    from lic_drake.select.registry import IMAGINE, check_method, needs_library

    shipped = [library.name for library in shipped_libraries()]
    path = find_library(args.category)
    if not path.exists():
        known = ", ".join(shipped)
        raise LicError(f"no category or library {args.category!r}; choose one of {known}")
    if not needs_library(args.method) or args.method == IMAGINE:
        raise LicError(f"--method {args.method} estimates nothing to be shown; choose gp or knn")
    if len(check_method(args.method)) > 1:
        raise LicError(f"--method {args.method} is two strategies; choose one, gp or knn")
    with quick_imports():  # So that the collector is quick when a slider moves, too.
        from lic_drake.experience.store import ExperienceLibrary

        meshcat = _listen(ExperienceLibrary(path).scenario(), args.port)
        explorer = _explore(meshcat, path, args.method)
    _announce(meshcat)
    while True:
        path = shipped_library(explorer.run([name for name in shipped if name != path.name]))
        explorer = _explore(meshcat, path, args.method)


def _explore(meshcat: "Meshcat", path: Path, method: str) -> "Explorer":
    """Shows the category of a library, after learning from it."""
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.select.lic import LicSelector
    from lic_drake.select.registry import make_selector
    from lic_drake.show.explore import Explorer

    library = ExperienceLibrary(path)
    scenario, columns = library.scenario(), library.columns()
    remark(f"learning from {len(columns['success'])} reaches of {scenario.category}")
    selector = make_selector(method, columns, say=remark)
    assert isinstance(selector, LicSelector)
    return Explorer(meshcat, scenario, selector)


def run_replay(args: argparse.Namespace) -> int:
    """Shows a row, again at each click, until it is interrupted."""
    from lic_drake.experience.store import ExperienceLibrary
    from lic_drake.reach.request import SIMULATION, ReachRequest
    from lic_drake.reach.session import instance_of

    library = ExperienceLibrary(args.library)
    scenario, rows = library.scenario(), library.table()
    if args.row >= len(rows):
        raise LicError(f"{library.path} has rows 0 to {len(rows) - 1}, got {args.row}")
    from lic_drake.experience.schema import to_records
    from lic_drake.show.explore import describe_record, play_request
    from lic_drake.show.stage import Screen

    (record,) = to_records(rows.slice(args.row, 1))
    if record.source != SIMULATION:
        raise LicError(f"row {args.row} is of {record.source}, not simulated; choose another row")
    request = ReachRequest.from_record(record, scenario)
    meshcat = _listen(scenario, args.port)
    screen = Screen(meshcat, scenario, instance_of(request))
    print(f"row {args.row}, {record.stream} environment {record.environment}:", end=" ")
    print(describe_record(record))
    _announce(meshcat)
    meshcat.AddButton("play", "KeyP")
    played = -1
    while True:
        if (clicks := meshcat.GetButtonClicks("play")) != played:
            played = clicks
            again, _ = play_request(request, screen)
            if again.outcome != record.outcome:
                print(f"simulated here, it is {describe_record(again)}", flush=True)
        time.sleep(_PAUSE_S)


def _listen(scenario: "Scenario", port: int | None) -> "Meshcat":
    """Returns a Meshcat at a port; a LicError if that is in use."""
    from lic_drake.show.stage import open_meshcat

    try:
        if port is None or port <= _LAST_PORT:  # Meshcat would take what is left modulo 65536.
            return open_meshcat(scenario.arm().is_planar, port)
    except RuntimeError:
        pass
    raise LicError(
        f"cannot listen on port {'7000 to 7999' if port is None else port}, which is in use or does"
        f" not exist; choose another --port from 1024 to {_LAST_PORT}"
    )


def _announce(meshcat: "Meshcat") -> None:
    """Prints the address."""
    import socket

    print(
        f"open {meshcat.web_url()} (from another machine http://{socket.gethostname()}:"
        f"{meshcat.port()}) and its controls; Ctrl-C ends it",
        flush=True,
    )
