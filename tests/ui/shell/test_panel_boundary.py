"""Test that the shell knows no panel: it calls only methods that every panel has."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import app.ui.shell
from app.ui.panels.base import PanelWidget
from app.ui.shell.docking.dock import FailedPanel

SHARED = {"base", "command", "home", "registry"}
"""Modules of `app.ui.panels` that the shell may import."""


def violations(tree: ast.AST) -> Iterator[str]:
    """Yield each place that names a panel's module, class or own method."""
    for node in ast.walk(tree):
        match node:
            case ast.ImportFrom(module=str(module)) if module.startswith("app.ui.panels"):
                names = [f"{module}.{alias.name}" for alias in node.names]
                yield from (name for name in names if name.split(".")[3] not in SHARED)
            case ast.Import():
                names = [alias.name for alias in node.names if alias.name.startswith("app.ui.panels.")]
                yield from (name for name in names if name.split(".")[3] not in SHARED)
            case ast.Name(id="runtime_checkable"):
                yield "runtime_checkable"
            case ast.Call(func=ast.Name(id="isinstance" | "hasattr" | "getattr"), args=[subject, kind, *_]):
                if _is_panel(subject) and ast.unparse(kind) != FailedPanel.__name__:
                    yield ast.unparse(node)
            case ast.Attribute(value=subject, attr=name):
                if _is_panel(subject) and not hasattr(PanelWidget, name):
                    yield ast.unparse(node)


def _is_panel(node: ast.expr) -> bool:
    return isinstance(node, ast.Attribute) and node.attr == "panel"


@pytest.mark.parametrize(
    "path", sorted(Path(app.ui.shell.__file__).parent.rglob("*.py")), ids=lambda path: path.stem
)
def test_shell_names_no_panel_and_no_method_of_a_panel(path: Path) -> None:
    assert list(violations(ast.parse(path.read_text("utf-8")))) == []


@pytest.mark.parametrize(
    "code",
    [
        "from app.ui.panels.watch.doctor import DoctorPanel",
        "from app.ui.panels.watch import doctor",
        "import app.ui.panels.watch.doctor",
        "@runtime_checkable\nclass SupportsUndo(Protocol): ...",
        "if isinstance(dock.panel, SupportsUndo): ...",
        "dock.panel.undo()",
        "getattr(bench.docks['doctor'].panel, 'undo', None)",
    ],
)
def test_dependency_on_a_panel_is_detected(code: str) -> None:
    assert list(violations(ast.parse(code)))


def test_methods_of_every_panel_are_allowed() -> None:
    code = "from app.ui.panels.base import PanelWidget\ndock.panel.refresh()\ndock.panel.setFocus()"
    assert list(violations(ast.parse(code))) == []
