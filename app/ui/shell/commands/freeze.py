"""Command that freezes or unfreezes all open panels that have a freeze button."""

from __future__ import annotations

from PySide6.QtWidgets import QAbstractButton

from app.ui.shell.docking.workbench import Workbench


def freeze_buttons(bench: Workbench | None) -> list[QAbstractButton]:
    """Return the visible freeze buttons of the open panels; empty without a workbench."""
    panels = [bench.docks[name].panel for name in bench.open_names()] if bench is not None else []
    buttons = [panel.freeze_button() for panel in panels]
    return [button for button in buttons if button is not None and not button.isHidden()]


def all_frozen(bench: Workbench | None) -> bool:
    """Return True if at least one panel can be frozen, and all such panels are frozen."""
    buttons = freeze_buttons(bench)
    return bool(buttons) and all(button.isChecked() for button in buttons)


def toggle_freeze(bench: Workbench | None) -> None:
    """Freeze all panels, or unfreeze them if all are frozen."""
    should_freeze = not all_frozen(bench)
    for button in freeze_buttons(bench):
        button.setChecked(should_freeze)
