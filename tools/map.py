"""Draw the map of the rooms: docs/map.md, every folder with what lives there, and which imports which.

    python tools/map.py            write it anew
    python tools/map.py --check    1 when what is written is no longer true

Rooms are the packages of nep and app. An arrow says "imports"; one that follows from two others is left out.
`tests/test_map.py` compares the page with the code, so it can't grow old.
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
"""Each becomes a drawing of its rooms."""

Arrows = Mapping[str, frozenset[str]]

HEAD = """\
# The map

Made by `python tools/map.py`; `tests/test_map.py` keeps it true. The ways through the rooms are in
[CONTRIBUTING](../CONTRIBUTING.md#the-map). An arrow says "imports"; one that follows from two others is left
out.
"""


def graph() -> grimp.ImportGraph:
    """The imports of nep and app, also those for types alone."""
    return grimp.build_graph("nep", "app")


def arrows(of: grimp.ImportGraph, package: str) -> Arrows:
    """Which children of a package import which others, in themselves or anywhere below; no cycles."""
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
    """The fewest arrows from which all others follow (a transitive reduction)."""

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
    """One Mermaid drawing of what is directly in a package."""
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
    """The first sentence of a module's docstring."""
    found = ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or ""
    return found.partition("\n")[0].rstrip()


def rooms(folder: Path) -> Iterator[Path]:
    """A package and every package below it, parents first."""
    yield folder
    for inside in sorted(folder.iterdir()):
        if (inside / "__init__.py").exists():
            yield from rooms(inside)


def listing(package: str) -> str:
    """Every room of a package as one line: how deep it lies, its name, what lives there."""
    home = ROOT / package
    lines = []
    for room in rooms(home):
        deep = len(room.relative_to(home).parts)
        name = f"`{room.relative_to(ROOT).as_posix()}/`" if deep == 0 else f"`{room.name}/`"
        lines.append(f"{'  ' * deep}- {name} {said(room / '__init__.py')}")
    return "\n".join(lines)


def page() -> str:
    """The whole page."""
    of = graph()
    parts = [HEAD, "## Rooms", listing("app"), listing("nep"), "## Which imports which"]
    for package in DRAWN:
        parts += [f"### {package}", drawing(of, package)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write or check the page; 1 when it is not what the code says."""
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
