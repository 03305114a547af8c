"""Tests that files, modules, classes, decisions and links named in documents and sources exist."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests import syntax

pytestmark = pytest.mark.usefixtures("syntax_trees")
ROOT = Path(__file__).parents[1]
HOMES = ("nep", "app", "tests", "tools", "bench", "docs", "examples", "installers")
FILES = ("README.md", "CONTRIBUTING.md", "dev.py", "hatch_build.py", "pyproject.toml")
ELSEWHERE = frozenset({
    "app/_resources/",  # path inside a wheel
    "nep/locale/pt_BR/LC_MESSAGES/nep-studio.po",  # example of a new language
    "nep/Json",  # message types
    "nep/Msgpack",
    "nep/log",
    "tools/nothing.py",  # a missing file, used by a test
})  # fmt: skip

_PATH = re.compile(rf"(?<![\w/.~-])(?:{'|'.join(HOMES)}|resources)/[\w./-]*\.(?:py|ts|mjs|md|sh|css|json)\b")
_PLACE = re.compile(rf"(?:{'|'.join(HOMES)}|resources)/[\w./-]*")
_DECISION = re.compile(r"(?:\bADR |docs/adr/)(\d{4})")
_LINK = re.compile(r"\]\((?!\w+:)([^)#\s]+)")
_ANCHOR = re.compile(r"\]\((?!\w+:)([^)#\s]*)#([^)\s]+)\)")
_QUOTED = re.compile(r"`+([^`\n]+)`+")
_DOTTED = re.compile(r"(?:nep|app|tools|tests)(?:\.\w+)+")
_NAME = re.compile(r"(?:[A-Z][a-z0-9]+){2,}(?:\.\w+)*|[A-Z]\w*(?:\.\w+)+")
_WORD = re.compile(r"\w+")
_FILE_NAME = re.compile(r".*\.(?:md|json|csv|dll|nepb)")


@syntax.cached
def _texts() -> dict[str, str]:
    found = [ROOT / name for name in FILES]
    for home in HOMES:
        found += [
            path
            for path in (ROOT / home).rglob("*")
            if path.suffix in {".py", ".ts", ".mjs", ".md"} and "node_modules" not in path.parts
        ]
    own = Path(__file__)
    return {
        path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in found if path != own
    }


@syntax.cached
def _module(name: str) -> Path | None:
    place = ROOT / name.replace(".", "/")
    options = (place.with_name(place.name + ".py"), place / "__init__.py")
    return next((each for each in options if each.is_file()), None)


@syntax.cached
def _names_in(module: Path) -> frozenset[str]:
    """Return the names that a module binds, and the members of its classes."""
    tree = syntax.parse(module)
    names = {node.name for kind in (ast.ClassDef, ast.FunctionDef) for node in syntax.nodes(tree, kind)}
    names |= {node.id for node in syntax.nodes(tree, ast.Name)}
    names |= {node.attr for node in syntax.nodes(tree, ast.Attribute)}
    names |= {
        each.asname or each.name
        for kind in (ast.Import, ast.ImportFrom)
        for node in syntax.nodes(tree, kind)
        for each in node.names
    }
    return frozenset(names)


def _is_there(dotted: str) -> bool:
    """Return whether a dotted name is a package, a module, a name in a module or a public name of nep."""
    parts = dotted.split(".")
    for length in range(len(parts), 0, -1):
        module = _module(".".join(parts[:length]))
        if module is not None:
            rest = parts[length:]
            names = _names_in(module)
            if module == ROOT / "nep" / "__init__.py":
                names |= _names_in(ROOT / "nep" / "public.py")
            return not rest or rest[0] in names
    return False


@syntax.cached
def _words() -> frozenset[str]:
    """Return the words of the sources outside of backticks."""
    texts = [text for place, text in _texts().items() if not place.endswith(".md")]
    csharp = (
        path for folder in ("src", "unity") for path in (ROOT / "clients" / "csharp" / folder).rglob("*.cs")
    )
    texts += [path.read_text(encoding="utf-8") for path in csharp]
    return frozenset(word for text in texts for word in _WORD.findall(_QUOTED.sub(" ", text)))


def _quoted() -> Iterator[tuple[str, str]]:
    """Yield the file and the text of each quotation in backticks."""
    for place, text in _texts().items():
        if not place.endswith((".ts", ".mjs")):  # backticks are template strings there
            for quoted in _QUOTED.findall(text):
                yield place, quoted.removesuffix("()")


def test_every_referenced_file_exists() -> None:
    named = {(place, path) for place, text in _texts().items() for path in _PATH.findall(text)}
    named |= {(place, quoted) for place, quoted in _quoted() if _PLACE.fullmatch(quoted)}
    assert len(named) > 150
    missing = {(place, path) for place, path in named if not (ROOT / path).exists()}
    assert {each for each in missing if each[1] not in ELSEWHERE} == set()


def test_every_referenced_module_and_member_exists() -> None:
    named = [(place, quoted) for place, quoted in _quoted() if _DOTTED.fullmatch(quoted)]
    assert len(named) > 50
    assert {each for each in named if not _is_there(each[1])} == set()


def test_every_referenced_class_exists() -> None:
    named = [
        (place, quoted)
        for place, quoted in _quoted()
        if _NAME.fullmatch(quoted) and not _FILE_NAME.fullmatch(quoted)
    ]
    assert len(named) > 150
    assert {each for each in named if not _words().issuperset(each[1].split("."))} == set()


def test_every_referenced_decision_exists() -> None:
    there = {path.name[:4] for path in (ROOT / "docs" / "adr").glob("*.md")}
    named = {(place, number) for place, text in _texts().items() for number in _DECISION.findall(text)}
    assert len(named) > 20
    assert {each for each in named if each[1] not in there} == set()


def test_every_document_link_resolves() -> None:
    links = [
        (place, link)
        for place, text in _texts().items()
        if place.endswith(".md") and "0000-template" not in place
        for link in _LINK.findall(text)
    ]
    assert len(links) > 30
    assert {each for each in links if not ((ROOT / each[0]).parent / each[1]).exists()} == set()


@syntax.cached
def _anchors(page: Path) -> frozenset[str]:
    """Return the anchors that GitHub generates for the headings of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return frozenset(re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings)


def test_every_anchor_of_a_link_is_a_heading() -> None:
    links = {
        (place, page or Path(place).name, anchor)
        for place, text in _texts().items()
        if place.endswith(".md")
        for page, anchor in _ANCHOR.findall(text)
        if not page or page.endswith(".md")
    }
    assert len(links) > 30
    assert {
        (place, page, anchor)
        for place, page, anchor in links
        if anchor not in _anchors(((ROOT / place).parent / page).resolve())
    } == set()


@syntax.cached
def _trees() -> dict[str, ast.Module]:
    """Return the parsed modules of nep, app and tools by path."""
    return {
        place: syntax.parse(ROOT / place)
        for place in _texts()
        if place.startswith(("nep/", "app/", "tools/")) and place.endswith(".py")
    }


@syntax.cached
def _classes() -> dict[str, ast.ClassDef]:
    return {node.name: node for tree in _trees().values() for node in syntax.nodes(tree, ast.ClassDef)}


def _arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> set[str]:
    """Return the names of the arguments of a function."""
    declared = function.args
    found = [*declared.posonlyargs, *declared.args, *declared.kwonlyargs, declared.vararg, declared.kwarg]
    return {each.arg for each in found if each is not None}


@syntax.cached
def _members(of: ast.ClassDef) -> set[str]:
    """Return the attributes and methods of a class and its bases, and the arguments of its constructor."""
    names: set[str] = set()
    for node in ast.walk(of):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            names |= {node.name} | (
                _arguments(node) if node.name in {"__init__", "__new__", "__call__"} else set()
            )
        elif isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            names.add(node.id if isinstance(node, ast.Name) else node.attr)
    for base in of.bases:
        name = re.sub(r"\[.*", "", ast.unparse(base)).rpartition(".")[2]
        if name in _classes() and name != of.name:
            names |= _members(_classes()[name])
        elif name.endswith("Error"):
            names |= {"args", "name", "what"}
    return names


def _described(docstring: str) -> Iterator[str]:
    """Return the names that sections such as `Args:` describe."""
    for section in re.findall(
        r"^ *(?:Args|Attributes|Signals):\n((?:(?:    .*)?\n?)+)", docstring, re.MULTILINE
    ):
        yield from re.findall(r"^    \*{0,2}(\w+)(?=:| \()", section, re.MULTILINE)


def test_docstring_sections_describe_existing_names() -> None:
    count, missing = 0, set()
    for place, tree in _trees().items():
        for kind in (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef):
            for node in syntax.nodes(tree, kind):
                names = list(_described(ast.get_docstring(node) or ""))
                known = _members(node) if names and isinstance(node, ast.ClassDef) else set()
                known |= set() if isinstance(node, ast.ClassDef) else _arguments(node)
                count += len(names)
                missing |= {(place, node.name, name) for name in names if name not in known}
    assert count > 5000
    assert missing == set()


def test_missing_references_are_detected() -> None:
    assert _is_there("nep.masters.graph.Graph")
    assert _is_there("nep.node")
    assert not _is_there("nep.masters.graph.Nothing")
    assert not _is_there("app.core.nothing")
    assert not _words() & {"NoSuch" + "Class"}
    assert _PATH.findall("see `app/core/gone.py`, ../app/core/gone.py and x/app/core/gone.py") == [
        "app/core/gone.py"
    ]


@pytest.mark.parametrize("name", ["compare-blocks", "compare-monitors"])
def test_each_supported_row_of_a_comparison_names_existing_tests(name: str) -> None:
    rows = [
        line for line in (ROOT / "docs" / f"{name}.md").read_text("utf-8").splitlines()
        if line.startswith("| ") and not line.startswith(("| habit", "| feature"))
    ]  # fmt: skip
    assert len(rows) > 40
    for row in rows:
        *_marks, studio, tests = [cell.strip() for cell in row.strip("|").split("|")]
        named = re.findall(r"`(tests/[\w/]+\.py)::(test_\w+)`", tests)
        assert named or not studio.startswith("Y"), row
        for path, test in named:
            assert f"def {test}(" in (ROOT / path).read_text("utf-8"), f"{path}::{test}"
