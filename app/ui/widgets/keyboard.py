"""Keyboard helpers: keys without modifiers, and the tab order of widgets.

Queries of the tab order need a workaround. PySide makes the result of a getter without arguments a
child of the queried object. For the next widget in the focus chain and for a focus proxy that is wrong:
when the queried widget is deleted, PySide deletes the other one too, although Qt still uses it.
Therefore the parent of each result is restored immediately, and no other module in `app.ui` may make
these queries (ADR 0018).
"""

from __future__ import annotations

from collections.abc import Iterator

from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication, QWidget
from shiboken6 import isValid

_NAVIGATION_PROPERTY = "keyboardLeads"


def has_no_modifiers(event: QKeyEvent) -> bool:
    """Return True if a key was pressed without modifiers.

    On macOS, for example, Cmd+Down moves to the end of a text, but Down moves from a field to its list.
    The modifier that Qt sets for keys on a number pad, and for arrow keys on macOS, is ignored.
    """
    return not event.modifiers() & ~Qt.KeyboardModifier.KeypadModifier


def is_activation_key(key: int) -> bool:
    """Return True if a key activates the focused button: Enter or Space."""
    return key in {Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_Space}


def is_keyboard_navigation() -> bool:
    """Return True if the last input was keyboard navigation; only then the focus ring is shown."""
    application = QApplication.instance()
    return bool(application is not None and application.property(_NAVIGATION_PROPERTY))


def set_keyboard_navigation(is_navigation: bool) -> None:
    """Set whether the last input was keyboard navigation, and not a mouse button."""
    application = QApplication.instance()
    if application is not None:
        application.setProperty(_NAVIGATION_PROPERTY, is_navigation)


def next_in_focus_chain(widget: QWidget, *, forward: bool = True) -> QWidget:
    """Return the next widget in the focus chain of a window, or the widget itself if it is the only one.

    Args:
        widget: Widget in the chain.
        forward: False to return the previous widget.
    """
    neighbour = widget.nextInFocusChain() if forward else widget.previousInFocusChain()
    return widget if neighbour is None else _restore_parent(neighbour)


def focus_proxy(widget: QWidget) -> QWidget | None:
    """Return the focus proxy of a widget, or None."""
    proxy = widget.focusProxy()
    return None if proxy is None else _restore_parent(proxy)


def tab_stops(widget: QWidget, begin: QWidget, *, forward: bool = True) -> Iterator[QWidget]:
    """Yield the tab stops inside a widget in tab order.

    The iteration ends early at a widget that PySide confuses with a deleted one at the same address,
    because the next widget is then known only to Qt.

    Args:
        widget: Widget that contains the tab stops.
        begin: Widget after which the iteration starts.
        forward: False to iterate in reverse order.
    """
    step = next_in_focus_chain(begin, forward=forward)
    while step is not begin and isValid(step):
        accepts_tab = bool(step.focusPolicy() & Qt.FocusPolicy.TabFocus)
        if accepts_tab and step.isVisible() and step.isEnabled() and widget.isAncestorOf(step):
            yield step
        step = next_in_focus_chain(step, forward=forward)


def tab_stops_of(widget: QWidget) -> list[QWidget]:
    """Return a widget and its children as far as they are tab stops, in the order of their creation.

    The popup of a combo box is left out, because it is a separate window that can't be reached by Tab.
    """
    return [
        each
        for each in (widget, *widget.findChildren(QWidget))
        if each.focusPolicy() & Qt.FocusPolicy.TabFocus and each.window() is widget.window()
    ]


def _restore_parent(widget: QWidget) -> QWidget:
    # Restores the ownership in PySide; has no effect in Qt.
    if not isValid(widget):
        return widget
    QObject.setParent(widget, widget.parentWidget())
    return widget
