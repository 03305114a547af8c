"""Tests of commands and intents: every referenced command exists, and every intent has one handler."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

import pytest
from PySide6.QtWidgets import QMenu

import app
from app import intents
from app.intents import Intent
from app.ui import intents as window_intents
from app.ui.panels.base import Diagnose
from app.ui.panels.command import UnknownCommandError
from app.ui.panels.registry import PanelRegistry
from app.ui.shell.actions.actions import MENU_ROLES, STOP_COMMAND
from app.ui.shell.bars.run_bar import SPEED_COMMANDS
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.menus import LAYOUT_COMMANDS
from app.ui.shell.commands.table import COMMANDS, INTENT_COMMANDS, INTENTS, MENUS
from app.ui.shell.main_window import MainWindow
from tests.syntax import nodes, parse

pytest_plugins = ["tests.ui.shell_fixtures"]

PANEL_COMMANDS = [command for panel in PanelRegistry().values() for command in panel.commands]
IDS = {command.id for command in (*COMMANDS, *PANEL_COMMANDS)}
CALLS = {"run": 0, "_run": 0, "bind": 1, "assign_command": 1}
"""Functions that take a command id, with its argument position; `setProperty` is handled separately."""
INTENT_CLASSES = [
    *(each for module in (intents, window_intents) for each in vars(module).values() if isinstance(each, type)
      and issubclass(each, Intent) and each.__module__ == module.__name__),
    Diagnose,
]  # fmt: skip
"""All classes of intents; `Intent` and `BlockFix` are base classes."""


Constants = dict[str, str]


def said(node: ast.expr, constants: Constants) -> Iterator[str]:
    """Return the possible command ids of an expression, with "{}" for each unknown part."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.Name) and node.id in constants:
        yield constants[node.id]
    elif isinstance(node, ast.JoinedStr):
        parts = [part.value if isinstance(part, ast.FormattedValue) else part for part in node.values]
        yield "".join(next(said(part, constants), "{}") for part in parts)
    elif isinstance(node, ast.IfExp):
        yield from said(node.body, constants)
        yield from said(node.orelse, constants)


def named(path: Path) -> Iterator[tuple[str, int]]:
    """Return each command id that a module references and its line."""
    tree = parse(path)
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(node.value.value, str)
    }
    for node in nodes(tree, ast.Call):
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        given = []
        if called == "add_argument":  # argparse, not a command of the window
            continue
        if called == "setProperty" and list(said(node.args[0], constants)) == ["command"]:
            given.append(node.args[1])
        elif called in CALLS and len(node.args) > CALLS[called]:
            given.append(node.args[CALLS[called]])
        for each in given:
            for words in said(each, constants):
                yield words, node.lineno


def modules() -> list[Path]:
    """Return the modules that may reference commands; those of robots define actions instead."""
    root = Path(app.__file__).parent
    outside = {root / "robots", root / "blocks" / "runtime"}
    return [path for path in root.rglob("*.py") if not outside & set(path.parents)]


def is_known(words: str) -> bool:
    """Return whether the command table contains an id or a pattern with "{}"."""
    return any(fnmatch(known, words.replace("{}", "*")) for known in IDS) if "{}" in words else words in IDS


@cache
def found() -> list[tuple[Path, str, int]]:
    """All command references as (file, id, line); collecting takes seconds."""
    return [(path, words, line) for path in modules() for words, line in named(path)]


@pytest.mark.usefixtures("syntax_trees")
def test_command_references_in_core_code_panels_and_buttons_are_collected() -> None:
    words = {words for _, words, _ in found()}
    assert {"layout.{}", "help.doctor", "file.new", "edit.undo", "run.stop"} <= words
    assert len(words) > 25


@pytest.mark.usefixtures("syntax_trees")
def test_every_referenced_command_is_registered() -> None:
    unknown = [f"{path}:{line}: {words!r}" for path, words, line in found() if not is_known(words)]
    assert not unknown, "these name no command"


def test_lists_of_command_ids_contain_only_existing_commands() -> None:
    assert {*MENU_ROLES, *SPEED_COMMANDS, *LAYOUT_COMMANDS, STOP_COMMAND} <= IDS


@pytest.mark.parametrize("kind", INTENT_CLASSES, ids=lambda kind: kind.__name__)
def test_each_intent_has_one_handler(kind: type[Intent]) -> None:
    handled = [*INTENT_COMMANDS, *(each.kind for each in INTENTS)]
    handled += [handler.kind for panel in PanelRegistry().values() for handler in panel.intents]
    classes = {*kind.__mro__} - {Intent}
    expected = 0 if kind is Intent else 1
    assert len([each for each in handled if each in classes]) == expected
    assert set(INTENT_COMMANDS.values()) <= IDS


def test_request_of_an_intent_without_handler_raises_immediately(commands: Commands) -> None:
    with pytest.raises(UnknownCommandError, match="Intent"):
        commands.request(Intent())


@pytest.mark.parametrize("name", ["nonsense", "panel:topics", "panel.nonsense", "run.run:x", ""])
def test_unknown_command_raises_immediately(commands: Commands, name: str) -> None:
    with pytest.raises(UnknownCommandError, match="no command"):
        commands.run(name)
    with pytest.raises(UnknownCommandError):
        commands.actions[name]


def test_unknown_command_id_from_a_panel_raises_immediately(window: MainWindow) -> None:
    with pytest.raises(UnknownCommandError, match=r"help\.nobody"):
        window.context.run("help.nobody")
    with pytest.raises(UnknownCommandError):
        window.commands.shortcuts.shortcuts_of("help.nobody")


def test_command_ids_are_unique_and_each_menu_is_in_the_menu_bar() -> None:
    commands = [*COMMANDS, *PANEL_COMMANDS]
    assert len(IDS) == len(commands)
    assert {command.menu for command in commands} <= {*MENUS, ""}
    assert {command.after for command in commands} <= {*IDS, ""}


def test_every_menu_has_at_most_18_entries(window: MainWindow, commands: Commands) -> None:
    for menu in window.bar.menus.findChildren(QMenu):
        rows = [each for each in menu.actions() if each.isVisible() and not each.isSeparator()]
        assert len(rows) <= 18, f"{menu.title()} has {len(rows)} entries"
    view = next(menu for menu in window.bar.menus.findChildren(QMenu) if menu.title() == "&View")
    look = next(each.menu() for each in view.actions() if each.text() == "Appearance")
    assert commands.actions["theme.dark"] in look.actions()
