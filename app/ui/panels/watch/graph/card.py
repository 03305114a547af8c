"""Card with details of the topic, service or node selected in the graph, and with actions on it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.graph.node_graph import DrawnNode
from app.core.network.topics import Topic, key_of, split_key
from app.ui.intents import NewAlarm
from app.ui.panels.row_actions import departure_alarm, silence_alarm
from app.ui.panels.watch.graph.texts import finite_or_none, percent_text, short_rate
from app.ui.text.nodes import cpu_text, generation_text
from app.ui.text.numbers import age_text, bandwidth_text, group_digits, latency_text, rate_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Card,
    ContentScrollArea,
    ElidedLabel,
    IconButton,
    Separator,
    Sparkline,
    label,
    set_role,
)
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _, ngettext, number
from nep.messages.codecs import content_of

if TYPE_CHECKING:
    from nep.protocol.graph_view import GraphView, ServiceInfo

CARD_WIDTH = 316
MAX_ROWS = 40
"""Maximum number of rows in a table; the number of omitted rows is shown instead."""

Row = tuple[str, str, tuple[str, ...]]
"""Row of a table: key of the item to select on click ("" for none), name, and values."""


@dataclass(frozen=True, slots=True)
class CardTable:
    """Table of a card.

    Attributes:
        title: Title, which is also the header of the column with the names.
        columns: Headers of the columns with the values.
        rows: Rows of the table.
        item_kind: Kind of the items that the rows select, "node" or "topic".
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    item_kind: str = "node"


@dataclass(frozen=True, slots=True)
class CardStat:
    """Number of a card in large type, such as the rate of a topic.

    Attributes:
        title: Title above the number.
        value: Formatted number.
        note: Text below the number, or "".
        curve: Recent values to draw as a curve; empty for no curve.
        is_problem: True for a number that indicates a problem.
    """

    title: str
    value: str
    note: str = ""
    curve: tuple[float, ...] = ()
    is_problem: bool = False


@dataclass(frozen=True, slots=True)
class CardContent:
    """Contents of a card.

    Attributes:
        title: Name of the topic, service or node.
        kind: Short description below the title, such as the message type.
        stats: Numbers in large type.
        lines: Lines of text below the numbers.
        tables: Tables below the lines of text.
        footer: Text at the bottom of the card, or "".
    """

    title: str
    kind: str
    stats: tuple[CardStat, ...] = ()
    lines: tuple[str, ...] = ()
    tables: tuple[CardTable, ...] = ()
    footer: str = ""
    topic: str = ""
    """Key of the topic for the buttons *Inspect*, *Plot a field* and *Record topic*; "" hides the buttons."""
    has_fields: bool = False
    """True if the messages have fields to plot."""
    alarm: NewAlarm | None = None
    """Intent to create an alarm for the item; None if that isn't possible."""


class GraphCard(QWidget):
    """Widget that shows a `CardContent`. Only a change of the structure rebuilds the widgets of the card.

    Signals:
        closed: The close button was clicked.
        inspect_requested: Key of a topic to inspect.
        plot_requested: Key of a topic to plot.
        record_requested: Key of a topic to record.
        alarm_requested: Intent to create an alarm.
        select_requested: Kind and key of an item to select.
    """

    closed = Signal()
    inspect_requested = Signal(str)
    plot_requested = Signal(str)
    alarm_requested = Signal(object)
    record_requested = Signal(str)
    select_requested = Signal(str, str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.content: CardContent | None = None
        self.title = ElidedLabel("code", "text", min_width=60)
        self.kind = label("", "small", role="textTertiary")
        self.close_button = IconButton(theme, "x", _("Close"), size=24)
        self.close_button.clicked.connect(self.closed)
        self._content = QWidget()
        self._column = QVBoxLayout(self._content)
        self._column.setContentsMargins(14, 4, 14, 10)
        self._column.setSpacing(8)
        scroll = ContentScrollArea(self._content)
        scroll.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self._make_buttons()
        self.foot = label("", "small", role="textTertiary", wrap=True)
        self.foot.setContentsMargins(14, 5, 14, 7)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(self._header_row())
        column.addWidget(scroll, 1)
        column.addWidget(self.button_row)
        self._line = Separator(theme)
        column.addWidget(self._line)
        column.addWidget(self.foot)
        self._stat_boxes: list[_StatBox] = []
        self._tables: list[_Table] = []
        self.setAccessibleName(_("Selection"))
        self.hide()

    def _make_buttons(self) -> None:
        theme = self._theme
        self.inspect = Button(theme, _("Inspect"), "list-tree", size="form")
        self.inspect.clicked.connect(self._inspect)
        self.plot = Button(theme, _("Plot a field"), "chart-line", size="form")
        self.plot.clicked.connect(self._plot)
        self.alarm = Button(theme, _("New alarm"), "bell", size="form")
        self.alarm.clicked.connect(self._request_alarm)
        self.record = Button(theme, _("Record topic"), "circle-dot", size="form")
        self.record.clicked.connect(self._record)
        self.button_row = QWidget()
        flow = Flow(self.button_row, gap=8, row_gap=6)
        flow.setContentsMargins(14, 6, 14, 8)
        for button in (self.inspect, self.plot, self.alarm, self.record):
            flow.addWidget(button)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.button_row.setSizePolicy(policy)

    def _header_row(self) -> QHBoxLayout:
        header = QHBoxLayout()
        header.setContentsMargins(14, 8, 8, 4)
        header.setSpacing(8)
        header.addWidget(self.title)
        header.addWidget(self.kind, 1)
        header.addWidget(self.close_button)
        return header

    def first_focus_widget(self) -> QWidget:
        """Return the first widget of the tab order: a row, else *Inspect*, else the close button."""
        buttons = [row.button for table in self._tables for row in table.rows]
        first = next((button for button in buttons if button.isVisibleTo(self)), None)
        return first or (self.inspect if self.inspect.isVisibleTo(self) else self.close_button)

    def _inspect(self) -> None:
        if self.content is not None and self.content.topic:
            self.inspect_requested.emit(self.content.topic)

    def _plot(self) -> None:
        if self.content is not None and self.content.topic:
            self.plot_requested.emit(self.content.topic)

    def _request_alarm(self) -> None:
        if self.content is not None and self.content.alarm:
            self.alarm_requested.emit(self.content.alarm)

    def _record(self) -> None:
        if self.content is not None and self.content.topic:
            self.record_requested.emit(self.content.topic)

    def show_content(self, content: CardContent | None) -> None:
        """Show other contents, or hide the card if `content` is None."""
        if content == self.content:
            return
        before, self.content = self.content, content
        if content is None:
            self.hide()
            return
        self.title.setText(content.title)
        self.kind.setText(content.kind)
        self.inspect.setVisible(bool(content.topic))
        self.plot.setVisible(bool(content.topic) and content.has_fields)
        self.alarm.setVisible(bool(content.alarm))
        self.button_row.setVisible(bool(content.topic or content.alarm))
        self.record.setVisible(bool(content.topic) and not split_key(content.topic)[0])
        self.foot.setText(content.footer)
        self.foot.setVisible(bool(content.footer))
        self._line.setVisible(bool(content.footer))
        if before is None or _structure_key(before) != _structure_key(content):
            self._rebuild(content)
        for box, stat in zip(self._stat_boxes, content.stats, strict=True):
            box.set_stat(stat)
        for table_widget, table in zip(self._tables, content.tables, strict=True):
            table_widget.set_table(table)
        self.show()

    def _rebuild(self, content: CardContent) -> None:
        while (item := self._column.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.hide()
                old.deleteLater()
        self._stat_boxes = [_StatBox(self._theme) for _stat in content.stats]
        if self._stat_boxes:
            card = Card()
            grid = QGridLayout(card)
            grid.setContentsMargins(12, 8, 12, 8)
            grid.setHorizontalSpacing(12)
            grid.setVerticalSpacing(8)
            for index, box in enumerate(self._stat_boxes):
                grid.addWidget(box, index // 2, index % 2, Qt.AlignmentFlag.AlignTop)
            grid.setColumnStretch(0, 1)
            grid.setColumnStretch(1, 1)
            self._column.addWidget(card)
        for line in content.lines:
            self._column.addWidget(label(line, "body", role="textSecondary", wrap=True))
        self._tables = [_Table(self._theme, table, self.select_requested.emit) for table in content.tables]
        for table_widget in self._tables:
            self._column.addWidget(table_widget)
        self._column.addStretch(1)


def _structure_key(content: CardContent) -> object:
    # Widgets are rebuilt only when this value changes.
    tables = [(table.title, table.columns, [row[:2] for row in table.rows]) for table in content.tables]
    return content.title, len(content.stats), content.lines, tables


class _StatBox(QWidget):
    """Number in large type with title, note and curve."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._title = label("", "small", role="textTertiary")
        self._value = label("", "heading")
        self._note = label("", "small", role="textSecondary", wrap=True)
        self._curve = Sparkline(theme)
        row = QHBoxLayout()
        row.setSpacing(6)
        row.addWidget(self._value, 1)
        row.addWidget(self._curve, 0, Qt.AlignmentFlag.AlignBottom)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(1)
        column.addWidget(self._title)
        column.addLayout(row)
        column.addWidget(self._note)

    def set_stat(self, stat: CardStat) -> None:
        self._title.setText(stat.title)
        if self._value.text() != stat.value:
            self._value.setText(stat.value)
        self._note.setText(stat.note)
        self._curve.set_values(stat.curve)
        self._curve.setVisible(len(stat.curve) > 1)
        set_role(self._value, "warn" if stat.is_problem else "text")
        self.setAccessibleName(f"{stat.title}: {stat.value}")


@dataclass(slots=True)
class _TableRow:
    button: LinkButton
    value_labels: list[QWidget]


class _Table(QWidget):
    """Table of clickable names with values to their right."""

    def __init__(self, theme: Theme, table: CardTable, on_select: Callable[[str, str], object]) -> None:
        super().__init__()
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 4, 0, 0)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(2)
        grid.setColumnStretch(0, 1)
        grid.addWidget(label(table.title, "title"), 0, 0)
        for column, heading in enumerate(table.columns, 1):
            grid.addWidget(
                label(heading, "small", role="textTertiary"), 0, column, Qt.AlignmentFlag.AlignRight
            )
        grid.addWidget(Separator(theme), 1, 0, 1, len(table.columns) + 1)
        self.rows: list[_TableRow] = []
        for row_index, (key, name, values) in enumerate(table.rows, 2):
            button = LinkButton(theme, name)
            button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
            button.setEnabled(bool(key))
            button.clicked.connect(lambda _on=False, key=key, kind=table.item_kind: on_select(kind, key))
            grid.addWidget(button, row_index, 0)
            value_labels: list[QWidget] = []
            for column, _value in enumerate(values, 1):
                value_labels.append(label("", "body"))
                grid.addWidget(value_labels[-1], row_index, column, Qt.AlignmentFlag.AlignRight)
            self.rows.append(_TableRow(button, value_labels))

    def set_table(self, table: CardTable) -> None:
        for row, (_key, _name, values) in zip(self.rows, table.rows, strict=True):
            for value_label, text in zip(row.value_labels, values, strict=True):
                if value_label.text() != text:  # type: ignore[attr-defined]
                    value_label.setText(text)  # type: ignore[attr-defined]


# -- contents ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class CardSources:
    """Sources of the information on a card.

    Attributes:
        topic_of: Returns a topic by key, or None.
        view: Graph reported by the master, or None.
        name_of: Returns the name of a node by key.
        box_of: Returns the key of the box that shows a node, or "" if the node is not drawn.
        call_rates_hz: Calls per second, by name of the service.
        is_visible: Returns False for topics to hide.
        now_ns: Returns the current time in ns since 1970.
    """

    topic_of: Callable[[str], Topic | None]
    view: GraphView | None
    name_of: Callable[[str], str]
    box_of: Callable[[str], str]
    call_rates_hz: Mapping[str, float]
    is_visible: Callable[[str], bool] = lambda _name: True
    now_ns: Callable[[], int] = time.time_ns


def topic_card(key: str, sources: CardSources) -> CardContent | None:
    """Return the contents of the card for a topic or service, or None if the key is unknown."""
    topic = sources.topic_of(key)
    if topic is not None:
        return _topic_content(topic, sources)
    service = sources.view.services.get(key) if sources.view is not None else None
    return _service_content(service, sources) if service is not None else None


def _topic_content(topic: Topic, sources: CardSources) -> CardContent:
    rate, bandwidth = finite_or_none(topic.rate_hz), finite_or_none(topic.bandwidth_Bps)
    size = bandwidth / rate if bandwidth and rate else None
    rates = tuple(topic.rates)
    minimum = _("recent minimum {rate}").format(rate=rate_text(min(rates))) if len(rates) > 1 else ""
    stats = (
        CardStat(_("Rate"), f"{rate_text(rate)} /s" if rate is not None else "", minimum, rates),
        CardStat(
            _("Bandwidth"),
            bandwidth_text(bandwidth),
            _("{size} per message").format(size=size_text(size)) if size else "",
        ),
        _loss_stat(topic),
        _latency_stat(topic),
    )
    info = topic.info
    publishers = tuple(
        _row(
            sources,
            key_of(topic.network, each.node_id),
            (rate_text(finite_or_none(each.rate_hz)), group_digits(each.last_seq)),
        )
        for each in (info.publishers if info is not None else ())[:MAX_ROWS]
    )
    subscribers = tuple(
        _row(sources, key_of(topic.network, each.node_id), _received_texts(each.received, each.lost))
        for each in (info.subscribers if info is not None else ())[:MAX_ROWS]
    )
    omitted_count = max(0, topic.publishers - MAX_ROWS) + max(0, topic.subscribers - MAX_ROWS)
    tables = (
        CardTable(_("Publishers"), (_("Rate /s"), _("Seq")), publishers),
        CardTable(_("Subscribers"), (_("Received"), _("Lost")), subscribers),
    )
    return CardContent(
        topic.name,
        topic.msg_type,
        stats,
        (_more_text(omitted_count),) if omitted_count else (),
        tuple(table for table in tables if table.rows),
        clock_offset_text(sources.view) if not topic.network else "",
        topic.key,
        content_of(topic.codec) != "image",
        None if topic.network else silence_alarm(topic.name),  # alarms work on Studio's own network only
    )


def _received_texts(received: int | None, lost: int | None) -> tuple[str, str]:
    return "" if received is None else group_digits(received), "" if lost is None else group_digits(lost)


def _more_text(count: int) -> str:
    return ngettext("{count} more not listed", "{count} more not listed", count).format(
        count=group_digits(count)
    )


def _loss_stat(topic: Topic) -> CardStat:
    if topic.lost is None:
        return CardStat(_("Lost"), "")
    ratio = topic.loss_ratio
    value = "0" if not topic.lost else percent_text(ratio) if ratio is not None else group_digits(topic.lost)
    note = ngettext("{count} message", "{count} messages", topic.lost).format(count=group_digits(topic.lost))
    return CardStat(_("Lost"), value, note if topic.lost else "", is_problem=bool(topic.lost))


def _latency_stat(topic: Topic) -> CardStat:
    # Measured only while the topic is subscribed to.
    newest = topic.newest
    latency = newest.latency_s if newest is not None else None
    if latency is None:
        return CardStat(_("Latency"), "", _("measured while a panel shows the topic"))
    return CardStat(_("Latency"), latency_text(latency), _("of the newest message"))


def _service_content(service: ServiceInfo, sources: CardSources) -> CardContent:
    rate = sources.call_rates_hz.get(service.name)
    stats = (
        CardStat(_("Calls"), group_digits(service.calls), short_rate(rate) if rate is not None else ""),
        CardStat(_("Errors"), group_digits(service.errors), is_problem=service.errors > 0),
    )
    servers = tuple(
        _row(sources, each.node_id, (group_digits(each.calls), group_digits(each.errors)))
        for each in service.servers[:MAX_ROWS]
    )
    clients = tuple(
        _row(sources, each.node_id, _received_texts(each.answered, each.failed))
        for each in service.clients[:MAX_ROWS]
    )
    tables = (
        CardTable(_("Servers"), (_("Answered"), _("Errors")), servers),
        CardTable(_("Clients"), (_("Answered"), _("Failed")), clients),
    )
    return CardContent(service.name, _("service"), stats, (), tuple(table for table in tables if table.rows))


def _row(sources: CardSources, node_key: str, values: tuple[str, ...]) -> Row:
    return sources.box_of(node_key), sources.name_of(node_key), values


def node_card(
    node: DrawnNode, services: Sequence[tuple[str, bool]], sources: CardSources
) -> CardContent | None:
    """Return the contents of the card for a node, or None for a collapsed group.

    Args:
        node: Node to describe.
        services: Services of the node, each with True if the node serves it, False if the node calls it.
        sources: Sources of the information.
    """
    entry = node.entry
    if entry is None:
        return None
    lines = [_("on {host}").format(host=entry.host)] if entry.host else []
    if entry.pid is not None:
        lines.append(_("pid {number}").format(number=entry.pid))
    if entry.since_ns and entry.gone_s is None:
        age_s = max(0.0, (sources.now_ns() - entry.since_ns) / 1e9)
        lines.append(_("joined {age} ago").format(age=age_text(age_s - age_s % 10)))
    if entry.gone_s is not None:
        lines.append(_("gone"))
    stats = (CardStat(_("Processor"), cpu_text(entry.cpu_ratio), _("of one core")),)
    tables = (
        _topics_table(_("Publishes"), entry.network, entry.published_topics, sources),
        _topics_table(_("Subscribes"), entry.network, entry.subscribed_topics, sources),
        CardTable(_("Serves"), (), tuple((name, name, ()) for name, serves in services if serves), "topic"),
        CardTable(
            _("Calls"), (), tuple((name, name, ()) for name, serves in services if not serves), "topic"
        ),
    )
    kind = ", ".join(filter(None, (entry.language, generation_text(entry))))
    return CardContent(
        node.name,
        kind,
        stats if entry.cpu_ratio is not None else (),
        (", ".join(lines),) if lines else (),
        tuple(table for table in tables if table.rows),
        alarm=None if entry.network else departure_alarm(entry.name),
    )


def _topics_table(title: str, network: str, names: Sequence[str], sources: CardSources) -> CardTable:
    rows: list[Row] = []
    names = [name for name in names if sources.is_visible(name)]
    for name in names[:MAX_ROWS]:
        key = key_of(network, name)
        topic = sources.topic_of(key)
        rate = "" if topic is None else rate_text(finite_or_none(topic.rate_hz))
        rows.append((key if topic is not None else "", split_key(key)[1], (rate,)))
    if len(names) > MAX_ROWS:
        rows.append(("", _more_text(len(names) - MAX_ROWS), ("",)))
    return CardTable(title, (_("Rate /s"),), tuple(rows), "topic")


def clock_offset_text(view: GraphView | None) -> str:
    """Format the largest uncertainty of the clock offsets between computers; "" if none was measured."""
    if view is None:
        return ""
    uncertainties = [node.clock_uncertainty_ns for node in view.nodes.values() if node.clock_uncertainty_ns]
    if not uncertainties:
        return ""
    return _("Clock offset accurate to ±{time} ms").format(time=number(max(uncertainties) / 1e6, ".1f"))
