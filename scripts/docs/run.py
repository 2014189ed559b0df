"""Builds the documentation site: the project's own pages, the lesson, and pdoc's reference.

python scripts/docs/run.py out/docs
"""

import html
import os
import re
import shutil
from pathlib import Path

import nbformat
import pdoc
import pdoc.render
from pdoc.render_helpers import to_html

from lic_drake.errors import LicError
from scripts.common import make_parser, run_script

CHECKOUT = Path(__file__).resolve().parents[2]
ROOMS = sorted(path.parent.name for path in (CHECKOUT / "lic_drake").glob("*/__init__.py"))
PAGES = {
    "Start": "README.md",
    "A lesson": "notebooks/README.md",
    "Examples": "scripts/examples/README.md",
    "Architecture": "lic_drake/README.md",
    "Ports of the diagram": "lic_drake/control/README.md",
    "Robots and scenarios": "models/README.md",
    "Results": "notebooks/results/README.md",
    "Experiments": "scripts/README.md",
    "Contributing": "CONTRIBUTING.md",
}
"""Title -> what the reader is led through, in this order; pages that they link to follow."""

_CODE = {".py": "python", ".yaml": "yaml", ".urdf": "xml", ".sh": "bash"}
_LINK = re.compile(r'(?<= )(href|src)="([^":#]+)(#[^"]*)?"')


def page_of(source: Path) -> Path:
    """Returns where the site has a file of the checkout, relative to it."""
    if source == Path("README.md"):
        return Path("index.html")
    is_page = source.suffix in (".md", ".ipynb", *_CODE)
    # Sources keep their ending: pdoc's page of lic_drake/seeds.py is lic_drake/seeds.html.
    return source.with_name(f"{source.name}.html") if is_page else source


def write_pages(out: Path) -> None:
    """Writes the pages and everything that they link to.

    Raises:
        LicError: A link leads nowhere.
    """
    pdoc.render.configure(docformat="google", template_directory=Path(__file__).parent)
    template = pdoc.render.env.get_template("page.html.jinja2")
    waiting, seen = [Path(name) for name in PAGES.values()], set[Path]()
    while waiting:
        source = waiting.pop()
        if source in seen:
            continue
        seen.add(source)
        page = out / page_of(source)
        page.parent.mkdir(parents=True, exist_ok=True)
        if page_of(source) == source:
            shutil.copyfile(CHECKOUT / source, page)
            continue
        body, linked = relink(to_body(CHECKOUT / source), source)
        waiting += linked
        root = "../" * (len(page_of(source).parts) - 1)
        pages = {title: f"{root}{page_of(Path(name))}" for title, name in PAGES.items()}
        api = {name: f"{root}lic_drake/{name}.html" for name in ROOMS}
        title = next((t for t, name in PAGES.items() if Path(name) == source), source.name)
        text = template.render(
            title=title, body=body, pages=pages, api={"lic_drake": f"{root}lic_drake.html"} | api
        )
        page.write_text(text, encoding="utf-8")


def to_body(source: Path) -> str:
    """Returns a page of Markdown, a notebook with its outputs or a source file as HTML."""
    if source.suffix == ".ipynb":
        notebook = nbformat.read(source, as_version=4)  # type: ignore[no-untyped-call]
        return "\n".join(_cell(cell) for cell in notebook.cells)
    text = source.read_text(encoding="utf-8")
    if source.suffix in _CODE:
        text = f"# {source.name}\n\n```{_CODE[source.suffix]}\n{text}\n```\n"
    return str(to_html(text))


def _cell(cell: nbformat.NotebookNode) -> str:
    if cell.cell_type == "markdown":
        return str(to_html(cell.source))
    parts = [str(to_html(f"```python\n{cell.source}\n```"))]
    for output in cell.outputs:
        data = output.get("data", {"text/plain": output.get("text", "")})
        if "image/png" in data:
            parts.append(f'<img alt="" src="data:image/png;base64,{data["image/png"].strip()}">')
        elif "text/markdown" in data:
            parts.append(str(to_html(data["text/markdown"])))
        elif "text/html" in data:
            parts.append(f'<div class="output">{data["text/html"]}</div>')
        else:
            parts.append(f'<pre class="output">{html.escape(data["text/plain"])}</pre>')
    return "\n".join(parts)


def relink(body: str, source: Path) -> tuple[str, list[Path]]:
    """Returns a page whose links lead to pages of the site, and what of the checkout these are."""
    linked = []

    def relink(match: re.Match[str]) -> str:
        kind, link, anchor = match.groups(default="")
        target = Path(os.path.relpath(CHECKOUT / source.parent / html.unescape(link), CHECKOUT))
        if (CHECKOUT / target).is_dir():
            target /= "README.md"
        if not (CHECKOUT / target).is_file():
            raise LicError(f"{source}: the link to {link} leads nowhere; correct it")
        linked.append(target)
        to = Path(os.path.relpath(page_of(target), page_of(source).parent)).as_posix()
        return f'{kind}="{to}{anchor}"'

    return _LINK.sub(relink, body), linked


def main() -> None:
    """Writes the site."""
    parser = make_parser(__doc__)
    parser.add_argument("out", type=Path, metavar="FOLDER")
    out = parser.parse_args().out
    pdoc.render.configure(docformat="google", template_directory=Path(__file__).parent)
    # The top level exports the API only, so its rooms are named.
    pdoc.pdoc("lic_drake", *(f"lic_drake.{room}" for room in ROOMS), output_directory=out)
    write_pages(out)
    print(out / "index.html")


if __name__ == "__main__":
    run_script(main)
