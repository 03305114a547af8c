"""Columns of the table of topics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from app.core.network.topic_tree import TopicFolder, TreeRow, split_name
from app.core.networks.kinds import NetworkKind, find_kind
from app.ui.text.numbers import age_text, bandwidth_text, group_digits, rate_text
from app.ui.widgets.table.model import Cell, Column
from nep.i18n import _, lazy, ngettext, number, pgettext

if TYPE_CHECKING:
    from app.core.network.topics import Topic

TOPIC_ICONS = {"image": "image", "json": "braces", "string": "type", "bytes": "binary", "msgpack": "braces"}


def _text_role(topic: Topic, role: str) -> str:
    return role if topic.gone_s is None and not topic.is_stale else "textDisabled"


def network_without_stats(topic: Topic) -> NetworkKind | None:
    """Return the kind of a topic's network if this network reports no statistics, else None."""
    kind = find_kind(topic.network)
    return kind if kind is not None and not kind.reports_stats else None


def name_cell(topic: Topic) -> Cell:
    """Return the cell with the name, bold with a chip while the topic is new, struck through when gone."""
    is_gone = topic.gone_s is not None
    chip = pgettext("topic", "new") if topic.is_new and not is_gone else None
    return Cell(
        topic.name,
        role=_text_role(topic, "text"),
        mono=True,
        bold=bool(chip),
        is_struck_out=is_gone,
        chip=chip,
    )


def network_cell(topic: Topic) -> Cell:
    """Return the cell of the Network column."""
    kind = find_kind(topic.network)
    if kind is None:
        return Cell("NEP", role=_text_role(topic, "textTertiary"))
    return Cell(kind.product_name, "waypoints", _text_role(topic, "textSecondary"))


def type_cell(topic: Topic) -> Cell:
    """Return the cell with icon and last part of the type; the tooltip has the full type."""
    icon = TOPIC_ICONS.get(topic.codec) or TOPIC_ICONS.get(topic.msg_type, "box")
    return Cell(topic.msg_type.rpartition("/")[2], icon, _text_role(topic, "textTertiary"))


def publishers_cell(topic: Topic) -> Cell:
    """Return the cell with the number of publishers."""
    return Cell(str(topic.publishers), role=_text_role(topic, "text"))


def subscribers_cell(topic: Topic) -> Cell:
    """Return the cell with the number of subscribers."""
    return Cell(str(topic.subscribers) if topic.gone_s is None else "", role=_text_role(topic, "text"))


def nodes_cell(topic: Topic) -> Cell:
    """Return the cell with the names of the publishing nodes."""
    return Cell(", ".join(topic.publisher_nodes), role=_text_role(topic, "textSecondary"))


def curve_cell(topic: Topic) -> Cell:
    """Return the cell with the curve of the rate in the last 30 s."""
    if topic.rate_hz is None and network_without_stats(topic) is not None:
        return Cell()  # a recorded topic has only the rates measured while it was open
    return Cell(role=_text_role(topic, "textSecondary"), curve=tuple(topic.rates))


def rate_cell(topic: Topic) -> Cell:
    """Return the cell with the rate in messages per second."""
    return Cell(rate_text(topic.rate_hz), role=_text_role(topic, "text"))


def bandwidth_cell(topic: Topic) -> Cell:
    """Return the cell with the bandwidth, which is unknown without subscribers."""
    if _is_size_unknown(topic):
        return Cell(bandwidth_text(None), role=_text_role(topic, "textDisabled"))
    return Cell(bandwidth_text(topic.bandwidth_Bps), role=_text_role(topic, "text"))


def _is_size_unknown(topic: Topic) -> bool:
    # Without subscribers messages are not encoded, so their size is unknown.
    return bool(topic.rate_hz) and not topic.bandwidth_Bps and not topic.subscribers


def _bandwidth_tip(topic: Topic) -> str:
    if _is_size_unknown(topic):
        return _("No subscribers: messages are counted, but their size is unknown")
    return _unreported_tip(topic)


def age_cell(topic: Topic) -> Cell:
    """Return the cell with the age of the newest message, or the time since the topic disappeared."""
    if topic.gone_s is not None:
        return Cell(_("gone for {seconds} s").format(seconds=int(topic.gone_s)), role="textDisabled")
    return Cell(age_text(topic.age_s), role=_text_role(topic, "text"))


def loss_cell(topic: Topic) -> Cell:
    """Return the cell with the loss ratio, with a warning icon unless the ratio is zero.

    If the number of lost messages is known, but not the ratio, the cell contains the number. The cell is
    empty if neither is known or the topic is gone. If the network reports no statistics at all, the cell
    contains a note that extends over the other columns.
    """
    kind = network_without_stats(topic)
    if kind is not None and topic.gone_s is None and (topic.rate_hz, topic.age_s, topic.lost) == (None,) * 3:
        return Cell(kind.unknown_text, role=_text_role(topic, "textTertiary"), overflows_left=True)
    if topic.lost is None or topic.gone_s is not None:
        return Cell()
    if topic.lost == 0:
        return Cell("0", role=_text_role(topic, "text"))
    loss_ratio = topic.loss_ratio
    return Cell(
        str(topic.lost)
        if loss_ratio is None
        else number(loss_ratio, ".1%" if loss_ratio < 0.0995 else ".0%").replace(
            "%", " %"
        ),  # no decimals at 100 %
        "triangle-alert",
        "warn",
    )


def _publishers_tip(topic: Topic) -> str:
    if not topic.publisher_nodes:
        return _("No publisher")
    return _("Published by {nodes}").format(nodes=", ".join(topic.publisher_nodes))


def _curve_tip(topic: Topic) -> str:
    if len(topic.rates) < 2:
        if network_without_stats(topic) is not None:
            return _unreported_tip(topic)
        return _("No rate reported yet")
    template = _("Recent rate: {least} to {most} /s")
    return template.format(least=rate_text(min(topic.rates)), most=rate_text(max(topic.rates)))


def _displayed_tip(topic: Topic) -> str:
    # Shown only if messages were dropped before they reached the panels.
    if not (topic.dropped or topic.missed):
        return ""
    displayed, sent = topic.displayed_and_sent_counts
    return _("{shown} of {sent} messages shown").format(
        shown=group_digits(displayed), sent=group_digits(sent)
    )


def _network_tip(topic: Topic) -> str:
    kind = find_kind(topic.network)
    if kind is None:
        return _("Studio's own network")
    if topic.is_stale:
        return _("{network} isn't responding; these are its last known values").format(
            network=kind.product_name
        )
    return _("On {network}, separate from Studio's own network").format(network=kind.product_name)


def _unreported_tip(topic: Topic) -> str:
    # Empty for networks whose publishers report the value.
    kind = network_without_stats(topic)
    if kind is None:
        return ""
    if topic.measured_rates is not None:
        return _("{network} doesn't report this; Studio measures it while the topic is open").format(
            network=kind.product_name
        )
    return _("{network} doesn't report this. Studio measures the topics you open").format(
        network=kind.product_name
    )


def _rate_tip(topic: Topic) -> str:
    return (
        _unreported_tip(topic)
        or _displayed_tip(topic)
        or _("Messages per second, as reported by the publishers")
    )


def _loss_tip(topic: Topic) -> str:
    displayed, kind = _displayed_tip(topic), network_without_stats(topic)
    if topic.lost is None and kind is not None:
        loss_text = _("{network} doesn't count lost messages").format(network=kind.product_name)
    elif topic.lost is None:
        loss_text = _("No subscriber reports losses")
    else:
        loss_text = ngettext("{count} message lost", "{count} messages lost", topic.lost)
        loss_text = loss_text.format(count=group_digits(topic.lost))
    return _("{lost}. {shown}").format(lost=loss_text, shown=displayed) if displayed else loss_text


COLUMNS: tuple[Column[Topic], ...] = (
    Column(
        "topic",
        lazy("Topic"),
        168,  # fits "/Pepper/description"
        name_cell,
        lambda t: t.name.casefold(),
        stretch=True,
        tip=lambda t: t.name,
    ),
    Column("type", lazy("Type"), 78, type_cell, lambda t: t.msg_type, tip=lambda t: t.msg_type),
    Column(
        "publishers",
        lazy("Publishers"),
        72,
        publishers_cell,
        lambda t: t.publishers,
        is_numeric=True,
        tip=_publishers_tip,
        hide_order=4,
    ),
    Column(
        "subscribers",
        lazy("Subscribers"),
        82,
        subscribers_cell,
        lambda t: t.subscribers,
        is_numeric=True,
        is_hidden_by_default=True,
    ),
    Column(
        "nodes", lazy("Published by"), 120, nodes_cell, lambda t: t.publisher_nodes, is_hidden_by_default=True
    ),
    Column("curve", "", 50, curve_cell, hide_order=5, label=lazy("Rate over time"), tip=_curve_tip),
    Column("rate", lazy("Rate /s"), 56, rate_cell, lambda t: t.rate_hz, is_numeric=True, tip=_rate_tip),
    Column(
        "bandwidth",
        lazy("Bandwidth"),
        75,
        bandwidth_cell,
        lambda t: t.bandwidth_Bps,
        is_numeric=True,
        tip=_bandwidth_tip,
        hide_order=3,
    ),
    Column(
        "age",
        lazy("Age"),
        58,
        age_cell,
        lambda t: t.age_s,
        is_numeric=True,
        tip=_unreported_tip,
        hide_order=2,
    ),
    Column(
        "loss",
        lazy("Loss"),
        74,
        loss_cell,
        lambda t: t.loss_ratio,
        is_numeric=True,
        tip=_loss_tip,
        hide_order=1,
    ),
)


NETWORK_COLUMN = Column("network", lazy("Network"), 84, network_cell, lambda t: t.network, tip=_network_tip)
INDENT, CHEVRON = 14, 19
"""Indentation of each level of the tree, and width of the arrow of a folder, in px."""


def _folder_name_cell(folder: TopicFolder) -> Cell:
    icon = "chevron-down" if folder.is_expanded else "chevron-right"
    return Cell(f"{folder.name}/", icon, mono=True, indent=folder.depth * INDENT)


def _folder_type_cell(folder: TopicFolder) -> Cell:
    count = len(folder.topics)
    text = ngettext("{count} topic", "{count} topics", count).format(count=group_digits(count))
    return Cell(text, role="textTertiary")


def _folder_loss_cell(folder: TopicFolder) -> Cell:
    lost = folder.stats.lost
    if not lost:
        return Cell() if lost is None else Cell("0")
    return Cell(group_digits(lost), "triangle-alert", "warn")


def _folder_loss_tip(folder: TopicFolder) -> str:
    lost = folder.stats.lost
    if lost is None:
        return _("No subscriber reports losses")
    template = ngettext("{count} message lost in {folder}", "{count} messages lost in {folder}", lost)
    return template.format(count=group_digits(lost), folder=folder.path)


def _sum_tip(folder: TopicFolder) -> str:
    return _("Total in {folder}").format(folder=folder.path)


FolderColumn = tuple[
    Callable[[TopicFolder], Cell], Callable[[TopicFolder], object], Callable[[TopicFolder], str] | None
]
FOLDER_COLUMNS: dict[str, FolderColumn] = {
    "topic": (_folder_name_cell, lambda f: f.path.casefold(), lambda f: f.path),
    "network": (
        lambda f: network_cell(f.topics[0]), lambda f: f.network, lambda f: _network_tip(f.topics[0])
    ),
    "type": (_folder_type_cell, lambda _f: "", None),
    "rate": (lambda f: Cell(rate_text(f.stats.rate_hz)), lambda f: f.stats.rate_hz, _sum_tip),
    "bandwidth": (
        lambda f: Cell(bandwidth_text(f.stats.bandwidth_Bps)), lambda f: f.stats.bandwidth_Bps, _sum_tip
    ),
    "age": (
        lambda f: Cell(age_text(f.stats.age_s)),
        lambda f: f.stats.age_s,
        lambda f: _("Newest message in {folder}").format(folder=f.path),
    ),
    "loss": (_folder_loss_cell, lambda _f: None, _folder_loss_tip),
}  # fmt: skip
"""Cell, sort key and tooltip for folders, by column; the other columns are empty for folders."""


BLANK_FOLDER_COLUMN: FolderColumn = (lambda _f: Cell(), lambda _f: None, None)


def _with_folders(column: Column[Topic], of_folder: FolderColumn) -> Column[TreeRow]:
    # Converts a column for topics to a column for rows of the tree.
    cell, key, tip = of_folder
    of_topic, topic_key, topic_tip = column.cell, column.key, column.tip

    def row_tip(row: TreeRow) -> str:
        if isinstance(row, TopicFolder):
            return tip(row) if tip is not None else ""
        return topic_tip(row) if topic_tip is not None else ""

    return Column(
        column.name,
        column.title,
        column.width,
        lambda row: cell(row) if isinstance(row, TopicFolder) else of_topic(row),
        (lambda row: key(row) if isinstance(row, TopicFolder) else topic_key(row)) if topic_key else None,
        is_numeric=column.is_numeric,
        stretch=column.stretch,
        tip=row_tip if topic_tip is not None else None,
        hide_order=column.hide_order,
        is_hidden_by_default=column.is_hidden_by_default,
        label=column.label,
        is_available=column.is_available,
    )


COMMON_COLUMNS = tuple(
    _with_folders(column, FOLDER_COLUMNS.get(column.name, BLANK_FOLDER_COLUMN)) for column in COLUMNS[1:]
)
"""Columns that do not depend on the arguments of `columns`."""


def columns(
    is_own: Callable[[Topic], bool], has_several_networks: Callable[[], bool], is_tree: Callable[[], bool]
) -> tuple[Column[TreeRow], ...]:
    """Return the columns of the table.

    Args:
        is_own: Returns True for Studio's own topics, which are never shown as new.
        has_several_networks: Returns True to show the network column.
        is_tree: Returns True if topics are shown below folders, with only the last part of their names.
    """

    def topic_name_cell(topic: Topic) -> Cell:
        cell = name_cell(topic)
        if cell.chip and is_own(topic):
            cell = replace(cell, bold=False, chip=None)
        if not is_tree():
            return cell
        parts = split_name(topic.name)
        return replace(cell, text=parts[-1], indent=(len(parts) - 1) * INDENT + CHEVRON)

    def folder_name_cell(folder: TopicFolder) -> Cell:
        cell = _folder_name_cell(folder)
        has_new = not folder.is_expanded and any(
            topic.is_new and topic.gone_s is None and not is_own(topic) for topic in folder.topics
        )
        return replace(cell, chip=pgettext("topic", "new")) if has_new else cell

    name_column = _with_folders(
        replace(COLUMNS[0], cell=topic_name_cell), (folder_name_cell, *FOLDER_COLUMNS["topic"][1:])
    )
    network_column = _with_folders(
        replace(NETWORK_COLUMN, is_available=has_several_networks), FOLDER_COLUMNS["network"]
    )
    return (name_column, network_column, *COMMON_COLUMNS)
