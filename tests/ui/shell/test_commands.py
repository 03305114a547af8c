"""Tests of the command table: every referenced command exists, and command arguments are typed."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import fields
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import get_args

import pytest
from PySide6.QtWidgets import QMenu

import app
from app.core.alerts.intents import Intent
from app.ui.intents import command_of
from app.ui.shell.actions.actions import MENU_ROLES, STOP_COMMAND
from app.ui.shell.actions.command import UnknownCommandError
from app.ui.shell.bars.run_bar import SPEED_COMMANDS
from app.ui.shell.commands.behaviours import TabPosition
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.menus import LAYOUT_COMMANDS
from app.ui.shell.commands.robots import RobotReplacement
from app.ui.shell.commands.table import ARGUMENT_COMMANDS, COMMANDS, MENUS
from app.ui.shell.main_window import MainWindow

pytest_plugins = ["tests.ui.shell_fixtures"]

IDS = {command.id for command in COMMANDS}
ABOUT = {command.id for command in ARGUMENT_COMMANDS}
CALLS = {"run": 0, "_run": 0, "bind": 1, "assign_command": 1, "Fix": 1, "_raise_alert": 1}
"""Functions that take a command id, with its argument position; `setProperty` is handled separately."""
KEYWORDS = {"action", "fix_action"}


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
    tree = ast.parse(path.read_text("utf-8"))
    constants = {
        target.id: node.value.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
        for target in node.targets
        if isinstance(target, ast.Name) and isinstance(node.value.value, str)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        given = [keyword.value for keyword in node.keywords if keyword.arg in KEYWORDS]
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
    id, colon, argument = words.partition(":")
    if id == "{}" and colon:  # menu of a tab: its commands are checked where they are listed
        return True
    if not colon and "{}" in id:
        return bool([known for known in IDS if fnmatch(known, id.replace("{}", "*"))])
    return id in ABOUT and bool(argument) if colon else id in IDS


@cache
def found() -> list[tuple[Path, str, int]]:
    """All command references as (file, id, line); collecting takes seconds."""
    return [(path, words, line) for path in modules() for words, line in named(path)]


def test_command_references_in_core_code_panels_and_buttons_are_collected() -> None:
    words = {words for _, words, _ in found()}
    assert {
        "limit:{}",
        "robot.use:{}:{}",
        "robot.virtual:{}",
        "tab.move:{}:{}",  # panels
        "edit.undo",  # buttons
        "run.stop",
    } <= words
    assert len(words) > 30


def test_every_referenced_command_is_registered() -> None:
    unknown = [f"{path}:{line}: {words!r}" for path, words, line in found() if not is_known(words)]
    assert not unknown, "these name no command"


def test_lists_of_command_ids_contain_only_existing_commands() -> None:
    assert {*MENU_ROLES, *SPEED_COMMANDS, *LAYOUT_COMMANDS, STOP_COMMAND} <= IDS


def test_every_tab_command_of_the_tab_menu_is_registered() -> None:
    source = (Path(app.__file__).parent / "ui" / "panels" / "build" / "behaviour" / "tabs.py").read_text(
        "utf-8"
    )
    listed = set(re.findall(r'"(tab\.[a-z_]+)"', source))
    assert len(listed) == 6
    assert listed <= ABOUT


@pytest.mark.parametrize("kind", get_args(Intent), ids=lambda kind: kind.__name__)
def test_next_step_of_an_alert_is_an_existing_command(kind: type[Intent]) -> None:
    assert is_known(command_of(kind(*("x" for _field in fields(kind)))))


@pytest.mark.parametrize("name", ["nonsense", "nonsense:x", "panel.nonsense", "run.run:x", ""])
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


def test_command_arguments_are_parsed_to_typed_values() -> None:
    assert TabPosition.parse("a:b:2") == TabPosition("a:b", 2)
    assert RobotReplacement.parse("NAO:Pepper:2") == RobotReplacement("NAO", "Pepper:2")
    with pytest.raises(ValueError, match="invalid literal"):
        TabPosition.parse("key:first")


def test_command_ids_are_unique_and_each_menu_is_in_the_menu_bar() -> None:
    assert len(IDS) == len(COMMANDS)
    assert len(ABOUT) == len(ARGUMENT_COMMANDS)
    assert {command.menu for command in COMMANDS} <= {*MENUS, ""}


def test_every_menu_has_at_most_18_entries(window: MainWindow, commands: Commands) -> None:
    for menu in window.bar.menus.findChildren(QMenu):
        rows = [each for each in menu.actions() if each.isVisible() and not each.isSeparator()]
        assert len(rows) <= 18, f"{menu.title()} has {len(rows)} entries"
    view = next(menu for menu in window.bar.menus.findChildren(QMenu) if menu.title() == "&View")
    look = next(each.menu() for each in view.actions() if each.text() == "Appearance")
    assert commands.actions["theme.dark"] in look.actions()
