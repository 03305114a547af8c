"""Tests that docs/map.md and CONTRIBUTING.md agree with the code, and of the size of packages."""

from __future__ import annotations

import re
from pathlib import Path

import grimp

from tools import map as package_map

ROOT = Path(__file__).parents[1]
MAX_ENTRIES = 18
"""Maximum number of entries in a package; lists of plug-ins and commands are exempt."""
LISTS = {"app/ui/panels"}
FILE = re.compile(r"`((?:nep|app)/[\w/]+\.(?:py|ts))`")


def test_map_and_table_of_packages_are_current() -> None:
    assert package_map.main(["--check"]) == 0, "packages have changed: run python tools/map.py"


def test_contributing_has_the_markers_of_the_table() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert text.count(package_map.BEGIN) == text.count(package_map.END) == 1


def test_transitive_imports_are_omitted_from_the_map() -> None:
    given = {"a": frozenset("bcd"), "b": frozenset("c"), "c": frozenset("d"), "d": frozenset[str]()}
    assert package_map.transitive_reduction(given) == {
        "a": frozenset("b"), "b": frozenset("c"), "c": frozenset("d"), "d": frozenset(),
    }  # fmt: skip


def test_imports_between_modules_count_for_their_packages() -> None:
    graph = grimp.ImportGraph()
    for name in ("p", "p.a", "p.a.x", "p.b", "p.b.y"):
        graph.add_module(name)
    graph.add_import(importer="p.a.x", imported="p.b.y")
    assert package_map.child_imports(graph, "p") == {"p.a": frozenset({"p.b"}), "p.b": frozenset()}


def test_data_flows_name_existing_files() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    flows = [part for part in page.split("\n\n") if part.startswith("**") and "\u2192" in part]
    assert len(flows) == 3
    for flow in flows:
        files = FILE.findall(flow)
        assert len(files) >= 8
        assert [each for each in files if not (ROOT / each).is_file()] == []


def test_packages_have_a_limited_number_of_entries() -> None:
    sources = [
        path
        for home in ("nep", "app")
        for path in (ROOT / home).rglob("*.py")
        if "node_modules" not in path.parts
    ]
    assert len(sources) > 300
    folders = {path.parent for path in sources}
    wide = {
        folder.relative_to(ROOT).as_posix(): count
        for folder in folders
        if (count := len([path for path in sources if path.parent == folder and path.stem != "__init__"])
            + len([other for other in folders if other.parent == folder])) > MAX_ENTRIES
    }  # fmt: skip
    assert set(wide) - LISTS == set()
