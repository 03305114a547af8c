"""What a person can do with a topic or a node, the same wherever it is listed or drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from PySide6.QtGui import QGuiApplication

from app.core.network.topics import split_key
from app.ui.panels.base import PanelContext
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from nep.i18n import _


class RowAction(NamedTuple):
    """An entry in the menu of a row: its words, its icon, what it does."""

    words: str
    icon: str
    run: Callable[[], object]


def filled(menu: Menu, theme: Theme, actions: Iterable[RowAction]) -> Menu:
    """The menu with these entries in it."""
    for action in actions:
        menu.addAction(theme.icon(action.icon), action.words, action.run)
    return menu


def topic_actions(context: PanelContext, key: str) -> list[RowAction]:
    """What can be done with a topic, by the name that it has among those of all networks (`key_of`)."""
    network, name = split_key(key)
    actions = [
        RowAction(_("Show messages"), "list-tree", lambda: show_messages(context, key)),
        RowAction(_("Open in another panel"), "plus", lambda: context.open_beside(key)),
    ]
    if has_fields(context, key):
        actions.append(RowAction(_("Plot a field"), "chart-line", lambda: context.plot(key, "")))
    if not network:  # messages, alarms and recordings are of Studio's own network
        if has_fields(context, key):
            actions.append(
                RowAction(_("Publish to this topic"), "send", lambda: context.run(f"publish.topic:{key}"))
            )
        actions.append(RowAction(_("New alarm"), "bell", lambda: context.run(f"alarm.topic:{key}")))
        actions.append(RowAction(_("Record topic"), "circle-dot", lambda: context.run(f"record.topic:{key}")))
    return [*actions, copies(context, name)]


def service_actions(context: PanelContext, name: str) -> list[RowAction]:
    """What can be done with a service of Studio's own network."""
    return [
        RowAction(_("Call service"), "play", lambda: context.run(f"service.call:{name}")),
        copies(context, name),
    ]


def node_actions(context: PanelContext, network: str, name: str) -> list[RowAction]:
    """What can be done with a node of a network ("" is Studio's own)."""
    actions: list[RowAction] = []
    if not network:
        actions.append(RowAction(_("New alarm"), "bell", lambda: context.run(f"alarm.node:{name}")))
    return [*actions, copies(context, name)]


def copies(context: PanelContext, name: str) -> RowAction:
    """Copies the name of what it is about."""

    def copy() -> None:
        QGuiApplication.clipboard().setText(name)
        context.toast(_("Copied {path}").format(path=name))

    return RowAction(_("Copy name"), "copy", copy)


def show_messages(context: PanelContext, key: str) -> None:
    """Show the messages of a topic; it is not new any more."""
    context.session.mark_seen(key)
    context.open_topic(key)


def has_fields(context: PanelContext, key: str) -> bool:
    """Whether there may be something to plot in its messages: there is nothing in pictures."""
    topic = context.session.topic(key)
    return topic is None or topic.codec != "image"
