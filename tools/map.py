"""Write docs/map.md: all packages with their purposes, and their imports.

    python tools/map.py          write the page
    python tools/map.py --check  exit with 1 if the page is out of date

Diagrams show imports between packages of nep and app, without those implied by others. `tests/test_map.py`
compares the page with the code.
"""

from __future__ import annotations

import argparse
import ast
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import grimp

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "map.md"
DRAWN = ("app", "app.ui", "app.core", "app.blocks", "app.robots", "nep")
"""Packages with a diagram."""

Arrows = Mapping[str, frozenset[str]]

HEAD = """\
# The map

Made by `python tools/map.py`; `tests/test_map.py` keeps it true. The ways through the rooms are in
[CONTRIBUTING](../CONTRIBUTING.md#the-map). An arrow says "imports"; one that follows from two others is left
out.
"""


def graph() -> grimp.ImportGraph:
    """Return the import graph of nep and app, including imports for type checking."""
    return grimp.build_graph("nep", "app")


def arrows(of: grimp.ImportGraph, package: str) -> Arrows:
    """Return the imports between a package's children, each with its subpackages; there are no cycles."""
    children = of.find_children(package)
    return {
        child: frozenset(
            other
            for other in children - {child}
            if of.direct_import_exists(importer=child, imported=other, as_packages=True)
        )
        for child in sorted(children)
    }


def without_what_follows(given: Arrows) -> Arrows:
    """Return the transitive reduction of the imports."""

    def reached(begin: str, seen: set[str]) -> set[str]:
        for each in given[begin] - seen:
            seen.add(each)
            reached(each, seen)
        return seen

    return {
        one: frozenset(
            other for other in others if not any(other in reached(each, set()) for each in others - {other})
        )
        for one, others in given.items()
    }


def drawing(of: grimp.ImportGraph, package: str) -> str:
    """Return a Mermaid diagram of a package's children."""
    lines = ["```mermaid", "graph TD"]
    reduced = without_what_follows(arrows(of, package))
    short = {name: name.rpartition(".")[2] for name in reduced}
    folders = {name for name in reduced if of.find_children(name)}
    lines += [
        f"  {short[name]}{f'[{short[name]}/]' if name in folders else f'({short[name]})'}" for name in reduced
    ]
    for name, others in reduced.items():
        lines += [f"  {short[name]} --> {short[other]}" for other in sorted(others)]
    return "\n".join([*lines, "```"])


def said(module: Path) -> str:
    """Return the first line of a module's docstring."""
    found = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or ""
    return found.partition("\n")[0].rstrip()


def rooms(folder: Path) -> Iterator[Path]:
    """Yield a package and all packages below it, parents first."""
    yield folder
    for inside in sorted(folder.iterdir()):
        if (inside / "__init__.py").exists():
            yield from rooms(inside)


def listing(package: str) -> str:
    """Return a list of all packages with the first line of their docstrings, indented by depth."""
    home = ROOT / package
    lines = []
    for room in rooms(home):
        deep = len(room.relative_to(home).parts)
        name = f"`{room.relative_to(ROOT).as_posix()}/`" if deep == 0 else f"`{room.name}/`"
        lines.append(f"{'  ' * deep}- {name} {said(room / '__init__.py')}")
    return "\n".join(lines)


def page() -> str:
    """Return the whole page."""
    of = graph()
    parts = [HEAD, "## Rooms", listing("app"), listing("nep"), "## Which imports which"]
    for package in DRAWN:
        parts += [f"### {package}", drawing(of, package)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the page; return 1 if it is out of date."""
    parser = argparse.ArgumentParser(description="Draw the map of the rooms.")
    parser.add_argument("--check", action="store_true", help="write nothing; 1 when the page is old")
    options = parser.parse_args(arguments)
    now = page()
    if options.check:
        return 0 if PAGE.exists() and PAGE.read_text(encoding="utf-8") == now else 1
    PAGE.write_text(now, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
