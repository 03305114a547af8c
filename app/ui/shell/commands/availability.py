"""Why a command can't be done now: menus grey it, the palette says the sentence."""

from __future__ import annotations

from app.ui.shell.commands.freeze import freezable
from app.ui.shell.main_window import MainWindow
from app.ui.theme.theme import TEXT_PERCENT

RUN = {
    "running": "A program runs already",
    "stopping": "Robots are being stopped",
    "unanswered": "A robot has not confirmed Stop",
}


def why_not(window: MainWindow, name: str) -> str:
    """A short reason without a full stop; "" when the command can be done."""
    view = window.session.runs.view()
    if name == "run.run" and not view.can_run:
        return RUN.get(view.state, "There is nothing to run")
    if name == "run.pause" and not view.can_pause:
        return "It is paused already" if view.state == "paused" else "Nothing runs"
    if name == "run.step" and not view.can_step:
        return RUN.get(view.state, "There is nothing to run")
    if name.startswith("edit.") and window.showing != "behaviour":
        return "Only in the Behaviour layout"
    if name in {"layout.reset", "panel.next", "panel.previous", "layout.keep"} and window.bench is None:
        return "The start page has no panels"
    if name in {"layout.rename", "layout.delete"} and not window.arrangements.own(window.showing):
        return "This layout came with Studio" if window.bench is not None else "The start page has no panels"
    if name == "view.freeze" and not freezable(window.bench):
        return "Nothing here can be frozen"
    if name == "file.forget_recent" and not window.session.settings.recent_known:
        return "The list is empty"
    return _of_text(window.theme.text_percent, name)


def _of_text(percent: int, name: str) -> str:
    if name == "text.larger" and percent >= TEXT_PERCENT[1]:
        return "Text is as large as it gets"
    if name == "text.smaller" and percent <= TEXT_PERCENT[0]:
        return "Text is as small as it gets"
    return ""
