"""The map of the rooms is true: what is drawn, what is said to stand where, how wide it may be."""

from __future__ import annotations

import re
from pathlib import Path

import grimp

from tools import map as rooms

ROOT = Path(__file__).parents[1]
WIDEST = 18
"""Entries on the widest level but for lists of plug-ins and of commands: one of many alike each."""
LISTS = {"app/ui/panels", "nep/cli"}
STATION = re.compile(r"`((?:nep|app)/[\w/]+\.(?:py|ts))`")


def test_the_page_is_what_the_code_says() -> None:
    assert rooms.main(["--check"]) == 0, "the rooms have changed: python tools/map.py"


def test_an_arrow_that_follows_from_others_is_left_out() -> None:
    given = {"a": frozenset("bcd"), "b": frozenset("c"), "c": frozenset("d"), "d": frozenset[str]()}
    assert rooms.without_what_follows(given) == {
        "a": frozenset("b"), "b": frozenset("c"), "c": frozenset("d"), "d": frozenset(),
    }  # fmt: skip


def test_arrows_are_of_whole_rooms() -> None:
    graph = grimp.ImportGraph()
    for name in ("p", "p.a", "p.a.x", "p.b", "p.b.y"):
        graph.add_module(name)
    graph.add_import(importer="p.a.x", imported="p.b.y")
    assert rooms.arrows(graph, "p") == {"p.a": frozenset({"p.b"}), "p.b": frozenset()}


def test_the_ways_lead_through_files_that_are_there() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    ways = [part for part in page.split("\n\n") if part.startswith("**") and "\u2192" in part]
    assert len(ways) == 3
    for way in ways:
        stations = STATION.findall(way)
        assert len(stations) >= 8
        assert [each for each in stations if not (ROOT / each).is_file()] == []


def test_every_folder_of_the_map_is_there() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    drawn = page.partition("## The map")[2].partition("[docs/map.md]")[0]
    inside = ""
    found = 0
    for line in drawn.splitlines():
        words = line.split()
        if line.startswith("    ") and words and words[0].endswith("/"):
            deep = len(line) - len(line.lstrip())
            inside = words[0] if deep == 4 else inside
            for each in [word for word in words if re.fullmatch(r"[\w/]+/[,;]?", word)]:
                name = each.rstrip(",;")
                places = [ROOT / name, ROOT / inside / name]
                places += [room / name for room in (ROOT / inside).rglob("*") if room.is_dir()]
                assert any(place.is_dir() for place in places), line
                found += 1
    assert found > 30


def test_no_level_is_too_wide() -> None:
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
            + len([other for other in folders if other.parent == folder])) > WIDEST
    }  # fmt: skip
    assert set(wide) - LISTS == set()
