"""Tests of the calls of `_` in the sources: placeholders are filled, and imports translate nothing."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from string import Formatter

import pytest

from tests import syntax

pytestmark = pytest.mark.usefixtures("syntax_trees")
ROOT = Path(__file__).resolve().parents[1]
CALLS = ("_", "ngettext", "pgettext")


@syntax.cached
def sources() -> dict[str, ast.Module]:
    """Return the modules with translatable texts by path."""
    found = {}
    for folder in ("nep", "app"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if "nep.i18n" in path.read_text(encoding="utf-8"):
                found[path.relative_to(ROOT).as_posix()] = syntax.parse(path)
    return found


def is_translated(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CALLS


def holes(call: ast.Call) -> set[str]:
    given = call.args[1:] if getattr(call.func, "id", "") == "pgettext" else call.args
    texts = [each.value for each in given if isinstance(each, ast.Constant) and isinstance(each.value, str)]
    return {
        name for text in texts for _text, name, _spec, _how in Formatter().parse(text) if name is not None
    }


def at_import(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the nodes that run during import: functions only with their defaults and decorators."""
    if isinstance(node, ast.Lambda):
        return
    yield node
    if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
        parts = [*node.decorator_list, *node.args.defaults, *filter(None, node.args.kw_defaults)]
    else:
        parts = list(ast.iter_child_nodes(node))
    for part in parts:
        yield from at_import(part)


def test_every_translated_text_is_formatted_with_all_its_placeholders() -> None:
    wrong = []
    for path, module in sources().items():
        for node in ast.walk(module):
            if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
                continue
            call, names = node.func.value, {each.arg for each in node.keywords}
            if node.func.attr != "format" or not is_translated(call) or None in names:
                continue
            if any(isinstance(each, ast.Constant) for each in call.args) and holes(call) != names:
                wrong.append(f"{path}:{node.lineno} {sorted(holes(call) ^ names)}")
    assert wrong == []


def test_no_text_is_translated_at_import() -> None:
    """The command line is exempt: its modules are imported when a command runs."""
    early = [
        f"{path}:{node.lineno}"
        for path, module in sources().items()
        if not path.startswith("nep/cli/")
        for node in at_import(module)
        if isinstance(node, ast.Call) and is_translated(node)
    ]
    assert early == []
