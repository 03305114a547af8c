"""Keyboard helpers: keys without modifiers, and the tab order of widgets.

Queries of the tab order must not have side effects. PySide makes the result of a getter without arguments a
child of the queried object. For the next widget in the focus chain, or a focus proxy, that is wrong: when the
queried widget is deleted, PySide deletes the other one too, while Qt still uses it. Therefore each result
immediately gets its own parent back, and no other module in `app.ui` may make these queries (ADR 0018).
"""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget
from shiboken6 import isValid

_NAVIGATION_PROPERTY = "keyboardLeads"


def is_plain(event: QKeyEvent) -> bool:
    """Return True if a key press has no modifiers.

    On a Mac, for example, Cmd+Down moves to the end of a text, and Down into the list. The modifier of arrow
    keys on a Mac and of keys on a number pad is ignored.
    """
    return not event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier


def is_activation_key(key: int) -> bool:
    """Return True if a key activates the focused widget."""
    return key in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}


def is_keyboard_navigation() -> bool:
    """Return True if the keyboard moved the focus. Only then a focus ring is shown."""
    application = QApplication.instance()
    return bool(application is not None and application.property(_NAVIGATION_PROPERTY))


def set_keyboard_navigation(leads: bool) -> None:
    """Record whether the last input was a key that moves the focus, or a mouse button."""
    application = QApplication.instance()
    if application is not None:
        application.setProperty(_NAVIGATION_PROPERTY, leads)


def next_in_focus_chain(widget: QWidget, *, forward: bool = True) -> QWidget:
    """Return the next (or previous) widget in the window's focus chain; the widget itself if it is alone."""
    found = widget.nextInFocusChain() if forward else widget.previousInFocusChain()
    return widget if found is None else _restore_parent(found)


def focus_proxy(widget: QWidget) -> QWidget | None:
    """Return the focus proxy of a widget, or None."""
    found = widget.focusProxy()
    return None if found is None else _restore_parent(found)


def tab_stops(widget: QWidget, begin: QWidget, *, forward: bool = True) -> Iterator[QWidget]:
    """Yield the tab stops inside a widget in order, after (or before) ``begin``, each once.

    Ends early at a widget that PySide confuses with a deleted one at the same address: only Qt knows the next
    one.
    """
    step = next_in_focus_chain(begin, forward=forward)
    while step is not begin and isValid(step):
        takes = bool(step.focusPolicy() & Qt.FocusPolicy.TabFocus)
        if takes and step.isVisible() and step.isEnabled() and widget.isAncestorOf(step):
            yield step
        step = next_in_focus_chain(step, forward=forward)


def tab_stops_of(widget: QWidget) -> list[QWidget]:
    """Return the tab stops of a widget and its children, in the order of their creation.

    The popup of a combo box is a child, but a separate window that Tab does not reach.
    """
    return [
        each
        for each in (widget, *widget.findChildren(QWidget))
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus and each.window() is widget.window()
    ]


def _restore_parent(found: QWidget) -> QWidget:
    # Restores the ownership in PySide; has no effect in Qt.
    if not isValid(found):
        return found
    QObject.setParent(found, found.parentWidget())
    return found
