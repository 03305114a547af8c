"""Freezing what shows: every open panel that holds its message or its picture by a button of its own."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from PySide6.QtWidgets import QAbstractButton

from app.ui.shell.docking.workbench import Workbench


@runtime_checkable
class SupportsFreeze(Protocol):
    """A panel whose button ``freeze`` holds what it shows; the button hides when there is nothing."""

    freeze: QAbstractButton


def freezable(bench: Workbench | None) -> list[QAbstractButton]:
    """The buttons of the open panels that show something live now."""
    panels = [bench.docks[name].panel for name in bench.open_names()] if bench is not None else []
    buttons = [panel.freeze for panel in panels if isinstance(panel, SupportsFreeze)]
    return [button for button in buttons if not button.isHidden()]


def all_frozen(bench: Workbench | None) -> bool:
    """Whether there is something live, and all of it is held."""
    found = freezable(bench)
    return bool(found) and all(button.isChecked() for button in found)


def freeze_or_go_on(bench: Workbench | None) -> None:
    """Hold all of them; when all are held, let them go on."""
    on = not all_frozen(bench)
    for button in freezable(bench):
        button.setChecked(on)
