"""Topics: everything that is on the network, with its figures as the publishers tell them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from PySide6.QtWidgets import QVBoxLayout

from app.core.network.source import NODE_NAME
from app.core.networks.networks import network_words
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.network_table import NetworkTable, own_everywhere
from app.ui.panels.row_actions import RowAction, show_messages, topic_actions
from app.ui.panels.table_panel import TableWords
from app.ui.panels.topics.columns import columns
from app.ui.text.numbers import grouped
from app.ui.widgets import EmptyAction, label
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.i18n import _, lazy, listed, ngettext

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.core.network.topics import Topic
    from app.core.networks.kinds import NetworkKind

FOOT = lazy("Rates come from the publishers; nothing is subscribed but what you look at")
FOOT_OF_NETWORKS = lazy(
    "Rates come from the publishers; on {networks} nobody tells rates or losses, and what you look at is"
    " counted here"
)
RECORDED_FOOT = lazy("As recorded; an age is how long before the playhead")
WORDS = TableWords(
    title=lazy("Topics"),
    filter=lazy("Filter topics"),
    nothing_fits=lazy("No topic has these words"),
    clear_the_filter=lazy("Clear the filter to see all topics."),
    not_recorded=lazy("There are no topics in the recording yet"),
)
FIGURES_EVERY = 3  # refreshes of 30 a second: figures are renewed ten times a second
SORT_EVERY = 30
LIVELY = frozenset({"rate", "bandwidth", "age", "loss"})


class TopicsPanel(NetworkTable["Topic"]):
    """The table of topics, a filter in the title, a line about the figures below."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, WORDS, "radio-tower")
        self.count = label("", "small", role="textSecondary")
        self.header.insert(0, self.count)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        parts = ((self.pages, 1), (self.networks, 0), (self.line, 0), (self.foot, 0), (self.doctor, 0))
        for widget, stretch in parts:
            column.addWidget(widget, stretch)
        self._seen: tuple[object, ...] = ()
        self._ours: tuple[str, ...] = ()
        self._ticks = 0
        self._wanted = ""

    def make_model(self) -> TableModel[Topic]:
        return TableModel(columns(self._own, self.has_several), lambda topic: topic.key)

    def make_table(self, model: TableModel[Topic]) -> TableView[Topic]:
        return TableView(self.theme, model, "topic")

    def _own(self, topic: Topic) -> bool:
        """Whether only virtual robots that Studio itself started publish it, or Studio."""
        if topic.network:
            return own_everywhere(topic.publisher_nodes)
        if not topic.publisher_nodes:
            return topic.name.startswith(tuple(f"/{robot}/" for robot in self._ours))
        return {*self._ours, NODE_NAME}.issuperset(topic.publisher_nodes)

    def refresh(self) -> None:
        self._ticks += 1
        facts = self._facts()
        order = self.table.order.column
        lively = order is not None and order.name in LIVELY
        if facts != self._seen or (lively and self._ticks % SORT_EVERY == 0):
            self.rebuild()
        if self._ticks % FIGURES_EVERY == 0 and self.model.rowCount():
            self.table.tell_visible_changed()

    def _facts(self) -> tuple[object, ...]:
        topics, networks = self.session.topics, self.session.networks
        return topics.revision, len(topics), networks.revision, self.session.master.kind

    def source_changed(self) -> None:
        self._seen = ()

    def rebuild(self) -> None:
        self._seen = self._facts()
        topics = [*self.session.topics, *self.session.networks.topics]
        self._ours = self.session.launcher.virtual_robots
        words = self.filter_words()
        rows = [topic for topic in topics if all(word in _haystack(topic) for word in words)]
        self.model.set_rows(self.table.order.sort(rows))
        if self._wanted:
            self.show_topic(self._wanted)
        self._say_counts(len(topics), len(rows) if words else None)
        self.show_table(bool(rows), bool(words))
        self.show_networks()
        recorded = self.session.replay is not None
        kinds = [network.kind for network in self.session.networks.chosen]
        self.foot.setText(_(RECORDED_FOOT) if recorded else _foot(kinds))
        self.foot.setVisible(bool(rows))
        self.line.setVisible(bool(rows))

    def _say_counts(self, known: int, found: int | None) -> None:
        nodes = len(self.session.networks.nodes)
        if self.session.graph is not None:
            nodes += len(self.session.graph.nodes)
        if found is None:
            words = ngettext("{count} topic", "{count} topics", known)
        else:
            words = ngettext("{found} of {count} topic", "{found} of {count} topics", known)
        words = words.format(count=grouped(known), found=found)
        if nodes:
            there = ngettext("{count} node", "{count} nodes", nodes).format(count=grouped(nodes))
            words = _("{topics}, {nodes}").format(topics=words, nodes=there)
        self.count.setText(words if known else "")
        self.filter.setVisible(known > 0)

    def say_empty(self) -> None:
        if self.session.master.kind == "searching":
            said = _("At {address}.").format(address=self.session.master.address)
            self.empty.say(_("Looking for a master"), said, "radio-tower")
            self.empty.set_actions([])
        else:
            self.empty.say(_("No topics yet"), _("They appear as soon as a program publishes."), "list")
            self.empty.set_actions(
                [EmptyAction(_("Use the virtual robot"), self._use_virtual, "bot", primary=True)]
            )

    def _use_virtual(self) -> None:
        self.context.run("robots.virtual")

    def open_row(self, key: str) -> None:
        show_messages(self.context, key)

    def row_actions(self, key: str) -> Sequence[RowAction]:
        return topic_actions(self.context, key)

    def show_topic(self, name: str) -> None:
        self._wanted = "" if self.model.index_of(name).isValid() else name  # its row may still come
        self.table.choose(name)


def _foot(kinds: Sequence[NetworkKind]) -> str:
    """Where the figures come from."""
    untold = [kind.words for kind in kinds if not kind.tells_figures]
    if not untold:
        return _(FOOT)
    return _(FOOT_OF_NETWORKS).format(networks=listed(untold))


def _haystack(topic: Topic) -> str:
    words = (network_words(topic.network), topic.name, topic.msg_type, *topic.publisher_nodes)
    return " ".join(words).casefold()


PANEL = Panel("topics", WORDS.title, "list", (), TopicsPanel)
