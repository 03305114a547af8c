"""Footer of the inspector: path of the selected value, properties of the message, and legend."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QVBoxLayout, QWidget

from app.core.network.topics import split_key
from app.core.networks.kinds import find_kind
from app.core.timeline.times import clock_text
from app.ui.text import plain
from app.ui.text.numbers import age_text, group_digits, latency_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import FixedWidthLabel, IconButton, Separator, label
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.messages.inspected import InspectedMessage
    from app.core.networks.kinds import NetworkKind
    from nep.messages.message import Message

_MIN_DISPLAYED_LATENCY_S = 0.0001
"""Smallest uncertainty in s to display; smaller ones would be rounded to zero."""


def message_info(
    message: Message, since_ns: int = 0, network: NetworkKind | None = None, *, is_recorded: bool = False
) -> str:
    """Format the properties of a message, such as ``seq 18 204   412 B   latency 0.6 ms``.

    Unknown properties are omitted. The latency of messages from other computers is corrected by the
    clock offset and shown with its uncertainty (``3.2 ms ± 0.4 ms``).

    Args:
        message: Message with the properties measured on arrival.
        since_ns: Start of the subscription in ns since 1970. A latched message that was sent before
            this time shows its age instead of a latency.
        network: Kind of the topic's network; None for Studio's own network. The text says so if this
            network doesn't report sequence numbers or latency.
        is_recorded: True to show the time of day instead of the latency.
    """
    parts = [size_text(message.size_bytes)]
    if message.seq is not None:
        parts.insert(0, _("seq {number}").format(number=group_digits(message.seq)))
    if message.stamp_ns is not None:
        if is_recorded:
            parts.append(_("sent {clock}").format(clock=clock_text(min(message.stamp_ns, 2**62))))
        elif message.is_latched and message.stamp_ns < since_ns:
            age_s = (time.time_ns() - message.stamp_ns) / 1e9
            parts.append(_("latched, sent {age} ago").format(age=age_text(age_s)))
        else:
            parts += _latency_info(message)
    if network is not None:
        parts += _unreported_info(message, network.product_name)
    return "   ".join(parts)


def _latency_info(message: Message) -> list[str]:
    latency_s, uncertainty_s = message.latency_s or 0.0, message.latency_uncertainty_s
    if uncertainty_s and -uncertainty_s <= latency_s < 0:
        return [_("latency under {latency}").format(latency=latency_text(uncertainty_s))]
    if not 0 <= latency_s < 3600:
        return [] if uncertainty_s is not None else [_("latency unknown: clocks not synchronized")]
    text = latency_text(latency_s)
    if uncertainty_s:
        text = _("{latency} ± {uncertainty}").format(
            latency=text, uncertainty=latency_text(max(uncertainty_s, _MIN_DISPLAYED_LATENCY_S))
        )
    return [_("latency {latency}").format(latency=text)]


def _unreported_info(message: Message, network: str) -> Iterator[str]:
    if message.seq is None and message.stamp_ns is None:
        yield _("{network} doesn't report sequence numbers or latency").format(network=network)
    elif message.seq is None:
        yield _("{network} doesn't report sequence numbers").format(network=network)
    elif message.stamp_ns is None:
        yield _("{network} doesn't report latency").format(network=network)


class Legend(QLabel):
    """Legend of the coloured bars at the left of changed rows."""

    def __init__(self) -> None:
        super().__init__(_("changed"))
        self.setIndent(0)
        self.setProperty("kind", "small")
        self.setProperty("role", "changed")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.setAccessibleName(_("A bar on the left marks changed values"))


class Footer(QWidget):
    """Footer with the path of the selected value, copy buttons, and the properties of the message below.

    Attributes:
        since_ns: Start of the subscription in ns since 1970.
    """

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.since_ns = 0
        self._message: Message | None = None
        self.path = label("", "code", role="textSecondary")
        self.path.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.path.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self.copy_value = IconButton(theme, "copy", _("Copy value"), "Ctrl+C", size=26)
        self.copy_path = IconButton(theme, "link", _("Copy path"), "Ctrl+Shift+C", size=26)
        self.plot = IconButton(theme, "chart-line", _("Plot"), "Ctrl+Shift+L", size=26)
        self.info = FixedWidthLabel("small", "textTertiary")
        self.legend = Legend()
        rows = QVBoxLayout(self)
        rows.setContentsMargins(0, 0, 0, 0)
        rows.setSpacing(0)
        for parts in ((self.path, self.copy_value, self.copy_path, self.plot), (self.info, self.legend)):
            rows.addWidget(Separator(theme))
            row = QHBoxLayout()
            row.setContentsMargins(10, 3, 8, 3)
            row.setSpacing(2)
            row.addWidget(parts[0], 1)
            for part in parts[1:]:
                row.addWidget(part)
            rows.addLayout(row)

    def show_path(self, path: str) -> None:
        """Show the path of the selected value; "" if nothing is selected."""
        self.path.setText(path)
        self.path.setToolTip(plain.tip(path))
        for button in (self.copy_value, self.copy_path, self.plot):
            button.setEnabled(bool(path))

    def show_message(self, inspected: InspectedMessage) -> None:
        """Show the properties of a message; nothing changes without a message."""
        message = inspected.message
        if message is None or message is self._message:  # latency and age are those at its arrival
            return
        self._message = message
        network = find_kind(split_key(inspected.key)[0])
        text = message_info(message, self.since_ns, network, is_recorded=inspected.is_recorded)
        self.info.setText(text)
