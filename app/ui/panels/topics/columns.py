"""The columns of the table of topics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from app.core.networks.kinds import NetworkKind, kind_named
from app.ui.text.numbers import age_words, bandwidth_words, grouped, rate_words
from app.ui.widgets.table.model import Cell, Column
from nep.i18n import _, lazy, ngettext, number, pgettext

if TYPE_CHECKING:
    from app.core.network.topics import Topic

ICONS = {"image": "image", "json": "braces", "string": "type", "bytes": "binary", "msgpack": "braces"}


def _ink(topic: Topic, role: str) -> str:
    return role if topic.gone_s is None and not topic.stale else "textDisabled"


def untold(topic: Topic) -> NetworkKind | None:
    """The network that does not tell figures of this topic; None where they are told."""
    kind = kind_named(topic.network)
    return kind if kind is not None and not kind.tells_figures else None


def name_cell(topic: Topic) -> Cell:
    """The name: bold with a chip while new, struck through when it has vanished."""
    gone = topic.gone_s is not None
    chip = pgettext("topic", "new") if topic.new and not gone else None
    return Cell(topic.name, role=_ink(topic, "text"), mono=True, bold=bool(chip), struck=gone, chip=chip)


def network_cell(topic: Topic) -> Cell:
    """Which network it is on."""
    kind = kind_named(topic.network)
    if kind is None:
        return Cell("NEP", role=_ink(topic, "textTertiary"))
    return Cell(kind.words, "waypoints", _ink(topic, "textSecondary"))


def type_cell(topic: Topic) -> Cell:
    """The type's icon and word; of "robot/answer" the last one, the tooltip has the whole."""
    icon = ICONS.get(topic.codec) or ICONS.get(topic.msg_type, "box")
    return Cell(topic.msg_type.rpartition("/")[2], icon, _ink(topic, "textTertiary"))


def publishers_cell(topic: Topic) -> Cell:
    """How many programs publish it."""
    return Cell(str(topic.publishers), role=_ink(topic, "text"))


def subscribers_cell(topic: Topic) -> Cell:
    """How many programs subscribe it."""
    return Cell(str(topic.subscribers) if topic.gone_s is None else "", role=_ink(topic, "text"))


def nodes_cell(topic: Topic) -> Cell:
    """The names of the programs that publish it."""
    return Cell(", ".join(topic.publisher_nodes), role=_ink(topic, "textSecondary"))


def curve_cell(topic: Topic) -> Cell:
    """The rate of the last half minute."""
    if topic.rate_hz is None and untold(topic) is not None:
        return Cell()  # what was counted while somebody looked
    return Cell(role=_ink(topic, "textSecondary"), curve=tuple(topic.rates))


def rate_cell(topic: Topic) -> Cell:
    """Messages a second."""
    return Cell(rate_words(topic.rate_hz), role=_ink(topic, "text"))


def bandwidth_cell(topic: Topic) -> Cell:
    """Bytes a second."""
    return Cell(bandwidth_words(topic.bandwidth_Bps), role=_ink(topic, "text"))


def age_cell(topic: Topic) -> Cell:
    """How old the newest message is, or since when the topic is gone."""
    if topic.gone_s is not None:
        return Cell(_("gone {seconds} s").format(seconds=int(topic.gone_s)), role="textDisabled")
    return Cell(age_words(topic.age_s), role=_ink(topic, "text"))


def loss_cell(topic: Topic) -> Cell:
    """What was lost, with a warning when it is not nothing; blank when nobody knows.

    Where a network tells no figures it says so, in the place of all of them.
    """
    kind = untold(topic)
    if kind is not None and topic.gone_s is None and (topic.rate_hz, topic.age_s, topic.lost) == (None,) * 3:
        return Cell(kind.not_known, role=_ink(topic, "textTertiary"), spills=True)
    if topic.lost is None or topic.gone_s is not None:
        return Cell()
    if topic.lost == 0:
        return Cell("0", role=_ink(topic, "text"))
    share = topic.loss_ratio
    return Cell(
        number(share, ".1%").replace("%", " %") if share is not None else str(topic.lost),
        "triangle-alert",
        "warn",
    )


def _publishers_tip(topic: Topic) -> str:
    if not topic.publisher_nodes:
        return _("Nobody publishes it")
    return _("Published by {nodes}").format(nodes=", ".join(topic.publisher_nodes))


def _curve_tip(topic: Topic) -> str:
    if len(topic.rates) < 2:
        if untold(topic) is not None:
            return _not_told(topic)
        return _("Nobody has told a rate yet")
    said = _("Rate lately: {least} to {most} /s")
    return said.format(least=rate_words(min(topic.rates)), most=rate_words(max(topic.rates)))


def _shown_tip(topic: Topic) -> str:
    """What reached the panels, where it is not everything."""
    if not (topic.dropped or topic.missed):
        return ""
    shown, sent = topic.shown_of
    return _("Shown {shown} of {sent} sent").format(shown=grouped(shown), sent=grouped(sent))


def _network_tip(topic: Topic) -> str:
    kind = kind_named(topic.network)
    if kind is None:
        return _("Studio's own network")
    if topic.stale:
        return _("{network} does not answer; this is how it was last").format(network=kind.words)
    return _("On {network}, beside Studio's own network").format(network=kind.words)


def _not_told(topic: Topic) -> str:
    """Why a figure is missing, or where it comes from; empty where publishers tell it."""
    kind = untold(topic)
    if kind is None:
        return ""
    if topic.counted is not None:
        return _("Counted here while you look: on {network} nobody tells it").format(network=kind.words)
    return _("Not known on {network}: nobody tells it. What you look at is counted here").format(
        network=kind.words
    )


def _rate_tip(topic: Topic) -> str:
    return _not_told(topic) or _shown_tip(topic) or _("Messages a second, as the publishers tell")


def _loss_tip(topic: Topic) -> str:
    shown, kind = _shown_tip(topic), untold(topic)
    if topic.lost is None and kind is not None:
        lost = _("Not known on {network}: what is lost there is not counted").format(network=kind.words)
    elif topic.lost is None:
        lost = _("No subscriber tells what is lost")
    else:
        lost = ngettext("{count} message lost", "{count} messages lost", topic.lost)
        lost = lost.format(count=grouped(topic.lost))
    return _("{lost}. {shown}").format(lost=lost, shown=shown) if shown else lost


COLUMNS: tuple[Column[Topic], ...] = (
    Column(
        "topic",
        lazy("Topic"),
        168,  # "/Pepper/description" whole
        name_cell,
        lambda t: t.name.casefold(),
        stretch=True,
        tip=lambda t: t.name,
    ),
    Column("type", lazy("Type"), 90, type_cell, lambda t: t.msg_type, tip=lambda t: t.msg_type),
    Column(
        "publishers",
        lazy("Publishers"),
        72,
        publishers_cell,
        lambda t: t.publishers,
        figures=True,
        tip=_publishers_tip,
        yields=4,
    ),
    Column(
        "subscribers",
        lazy("Subscribers"),
        82,
        subscribers_cell,
        lambda t: t.subscribers,
        figures=True,
        off=True,
    ),
    Column("nodes", lazy("Published by"), 120, nodes_cell, lambda t: t.publisher_nodes, off=True),
    Column("curve", "", 50, curve_cell, yields=5, words=lazy("Rate over time"), tip=_curve_tip),
    Column("rate", lazy("Rate /s"), 56, rate_cell, lambda t: t.rate_hz, figures=True, tip=_rate_tip),
    Column(
        "bandwidth",
        lazy("Bandwidth"),
        75,
        bandwidth_cell,
        lambda t: t.bandwidth_Bps,
        figures=True,
        tip=_not_told,
        yields=3,
    ),
    Column("age", lazy("Age"), 58, age_cell, lambda t: t.age_s, figures=True, tip=_not_told, yields=2),
    Column(
        "loss", lazy("Loss"), 62, loss_cell, lambda t: t.loss_ratio, figures=True, tip=_loss_tip, yields=1
    ),
)


NETWORK = Column("network", lazy("Network"), 84, network_cell, lambda t: t.network, tip=_network_tip)


def columns(own: Callable[[Topic], bool], several: Callable[[], bool]) -> tuple[Column[Topic], ...]:
    """The columns; what is Studio's ``own`` is no news. Networks are told while there are ``several``."""

    def named(topic: Topic) -> Cell:
        cell = name_cell(topic)
        return replace(cell, bold=False, chip=None) if cell.chip and own(topic) else cell

    return (replace(COLUMNS[0], cell=named), replace(NETWORK, when=several), *COLUMNS[1:])
