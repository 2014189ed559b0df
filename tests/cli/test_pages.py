"""Every `lic` command that a page of the project shows is one that the command line takes."""

import re
import shlex
import subprocess
from pathlib import Path

import pytest

from lic_drake.cli.main import make_parser

CHECKOUT = Path(__file__).resolve().parents[2]


def commands() -> list[tuple[str, list[str]]]:
    """Pages and arguments of `lic`, in code spans, and in blocks with a command a line."""
    found = []
    listed = subprocess.run(
        ["git", "ls-files", "*.md"], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    for page in listed.stdout.split():
        text = (CHECKOUT / page).read_text(encoding="utf-8").replace("\\\n", " ")
        blocks = re.findall(r"```bash\n(.*?)```", text, re.DOTALL)
        lines = [line for block in blocks for line in block.splitlines()]
        for line in [*re.findall(r"`(lic [a-z][^`]*)`", text), *lines]:
            name, *arguments = shlex.split(re.sub(r"\$\w+", "1", line), comments=True) or [""]
            # Names alone, as of lic experience add, are mentions.
            if name.endswith("lic") and not all(word.isalpha() for word in arguments):
                found.append((page, arguments))
    return found


def test_every_command_of_the_pages_is_understood() -> None:
    shown = commands()
    if not shown:
        pytest.skip("pages are listed by git")
    assert {"README.md", "lic_drake/README.md"} <= {page for page, _ in shown}
    for page, arguments in shown:
        try:
            make_parser().parse_args(arguments)
        except SystemExit as error:
            if error.code:
                pytest.fail(f"{page}: lic {shlex.join(arguments)}")
