"""Context menu actions of topics, services and nodes, shared by all tables and diagrams."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from PySide6.QtGui import QGuiApplication

from app.core.network.topics import split_key
from app.ui.intents import NewAlarm, PublishMessage, RecordTopic, SelectService
from app.ui.panels.base import PanelContext
from app.ui.theme.theme import Theme
from app.ui.widgets.menus import Menu
from nep.i18n import _
from nep.messages.codecs import content_of
from nep.programs.alarms import AlarmCondition


class RowAction(NamedTuple):
    """Action in the context menu of a row.

    Attributes:
        text: Text in the menu.
        icon: Name of the icon.
        run: Called when the user selects the action.
    """

    text: str
    icon: str
    run: Callable[[], object]


def fill_menu(menu: Menu, theme: Theme, actions: Iterable[RowAction]) -> Menu:
    """Add actions to a menu and return the menu."""
    for action in actions:
        menu.addAction(theme.icon(action.icon), action.text, action.run)
    return menu


def topic_actions(context: PanelContext, key: str) -> list[RowAction]:
    """Return the context menu actions for a topic.

    Args:
        context: Functions of the window.
        key: Key of the topic: its name with the network, as returned by `key_of`.
    """
    network, name = split_key(key)
    actions = [
        RowAction(_("Show messages"), "list-tree", lambda: show_messages(context, key)),
        RowAction(_("Open in another panel"), "plus", lambda: context.open_to_side(key)),
    ]
    if has_fields(context, key):
        actions.append(RowAction(_("Plot a field"), "chart-line", lambda: context.plot(key, "")))
    if not network:  # publishing, alarms and recordings work on Studio's own network only
        if has_fields(context, key):
            publish = PublishMessage(key)
            actions.append(RowAction(_("Publish to this topic"), "send", lambda: context.request(publish)))
        actions.append(RowAction(_("New alarm"), "bell", lambda: context.request(silence_alarm(key))))
        actions.append(RowAction(_("Record topic"), "circle-dot", lambda: context.request(RecordTopic(key))))
    return [*actions, copy_action(context, name)]


def silence_alarm(topic: str) -> NewAlarm:
    """Return the intent to create an alarm on a topic without messages for 2 s."""
    return NewAlarm(AlarmCondition("silent", topic, for_s=2.0))


def departure_alarm(node: str) -> NewAlarm:
    """Return the intent to create an alarm on a node that leaves."""
    return NewAlarm(AlarmCondition("leaves", node))


def service_actions(context: PanelContext, name: str) -> list[RowAction]:
    """Return the context menu actions for a service of Studio's own network."""
    return [
        RowAction(_("Call service"), "play", lambda: context.request(SelectService(name))),
        copy_action(context, name),
    ]


def node_actions(context: PanelContext, network: str, name: str) -> list[RowAction]:
    """Return the context menu actions for a node.

    Args:
        context: Functions of the window.
        network: Network of the node; "" for Studio's own network.
        name: Name of the node.
    """
    actions: list[RowAction] = []
    if not network:
        actions.append(RowAction(_("New alarm"), "bell", lambda: context.request(departure_alarm(name))))
    return [*actions, copy_action(context, name)]


def copy_action(context: PanelContext, name: str) -> RowAction:
    """Return the action that copies a name to the clipboard."""

    def copy() -> None:
        QGuiApplication.clipboard().setText(name)
        context.show_toast(_("Copied {path}").format(path=name))

    return RowAction(_("Copy name"), "copy", copy)


def show_messages(context: PanelContext, key: str) -> None:
    """Show the messages of a topic and mark the topic as no longer new."""
    context.session.shown.mark_seen(key)
    context.open_topic(key)


def has_fields(context: PanelContext, key: str) -> bool:
    """Return False for topics with images, which have no fields to plot, else True."""
    topic = context.session.shown.topic(key)
    return topic is None or content_of(topic.codec) != "image"
