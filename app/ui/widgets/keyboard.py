"""Keys that hold nothing else down, and the order in which Tab goes through widgets.

The order is asked so that asking changes nothing. PySide takes whatever a getter without arguments returns
for a child of the object that was asked. Of the next widget in the focus chain, or a proxy, that is not
true: when the widget that was asked is deleted, PySide calls the other one, and what Qt made in it, deleted
too, while Qt goes on using it. So each gets its own parent back at once, and nothing else in `app.ui` may
ask these questions (ADR 0018).
"""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget
from shiboken6 import isValid

_LEADS = "keyboardLeads"


def is_plain(event: QKeyEvent) -> bool:
    """Whether nothing is held with a key: Cmd+Down goes to the end of a text on a Mac, Down into the list.

    Arrows of a Mac and keys of a number pad carry a mark of their own, which is nothing that is held.
    """
    return not event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier


def is_pressed_key(key: int) -> bool:
    """Whether a key presses what has the focus."""
    return key in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}


def keyboard_leads() -> bool:
    """Whether the keyboard led to where the focus is: only then it is ringed."""
    application = QApplication.instance()
    return bool(application is not None and application.property(_LEADS))


def set_keyboard_leads(leads: bool) -> None:
    """A key that moves the focus was pressed, or a button of the mouse."""
    application = QApplication.instance()
    if application is not None:
        application.setProperty(_LEADS, leads)


def following(widget: QWidget, *, forward: bool = True) -> QWidget:
    """The widget after this one in its window's focus chain, or the one before; itself when it is alone."""
    found = widget.nextInFocusChain() if forward else widget.previousInFocusChain()
    return widget if found is None else _own_again(found)


def proxy_of(widget: QWidget) -> QWidget | None:
    """The widget that gets the keyboard in its place; None when it takes it itself."""
    found = widget.focusProxy()
    return None if found is None else _own_again(found)


def tab_stops(widget: QWidget, begin: QWidget, *, forward: bool = True) -> Iterator[QWidget]:
    """What takes the keyboard by Tab inside a widget, in order, after (or before) ``begin``; each once.

    It ends early at a widget that PySide takes for one that was deleted at the same address: only Qt itself
    knows what comes behind that.
    """
    step = following(begin, forward=forward)
    while step is not begin and isValid(step):
        takes = bool(step.focusPolicy() & Qt.FocusPolicy.TabFocus)
        if takes and step.isVisible() and step.isEnabled() and widget.isAncestorOf(step):
            yield step
        step = following(step, forward=forward)


def stops_of(widget: QWidget) -> list[QWidget]:
    """What takes the keyboard by Tab of a widget and in it, in the order in which it was made.

    The list that a combo box drops is its child, but a window of its own: Tab does not go there.
    """
    return [
        each
        for each in (widget, *widget.findChildren(QWidget))
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus and each.window() is widget.window()
    ]


def _own_again(found: QWidget) -> QWidget:
    """Tell PySide whose child this is: Qt, which knows it, finds nothing to do."""
    if not isValid(found):
        return found
    QObject.setParent(found, found.parentWidget())
    return found
