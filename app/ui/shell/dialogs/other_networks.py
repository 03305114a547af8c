"""Sheet to monitor other networks: a switch, an address and the state of each."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QLineEdit, QScrollArea, QVBoxLayout, QWidget

from app.core.networks.networks import Networks, OtherNetwork
from app.errors import SettingsError
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.numbers import group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import Separator, Switch, label, paint, set_role
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.menus import FieldContextMenu
from nep.errors import NepError
from nep.i18n import _, lazy, ngettext

WIDTH = 560
SWITCH_WIDTH = 132
REFRESH_MS = 300
SIDE_MARGIN, GAP, SCROLL_BAR_WIDTH = 19, 12, 10
INTRODUCTION = lazy(
    "Studio shows its own network. Turn on another network to see its topics and nodes as "
    "well. Studio only receives there and sends nothing."
)


class OtherNetworksSheet(Overlay):
    """Sheet of other networks. Changes are applied and saved immediately."""

    top = 96

    def __init__(self, theme: Theme, window: QWidget, networks: Networks) -> None:
        super().__init__(theme, window, _("Other networks"))
        self.rows = [NetworkRow(theme, each, networks) for each in networks]
        self.introduction = label(_(INTRODUCTION), "body", role="textSecondary", wrap=True)
        self._content = QWidget()
        self._content.setProperty("bare", "true")
        content_column = QVBoxLayout(self._content)
        content_column.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        content_column.setSpacing(GAP)
        content_column.addWidget(self.introduction)
        for row in self.rows:
            row.changed.connect(self.place)
            content_column.addWidget(Separator(theme))
            content_column.addWidget(row)
        self._area = QScrollArea()
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._area.viewport().setAutoFillBackground(False)
        self._area.setWidget(self._content)
        self._header = self.create_header(label(_("Other networks"), "heading"))
        self._header.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 14, 1, 16)
        column.setSpacing(10)
        column.addLayout(self._header)
        column.addWidget(self._area, 1)
        self._timer = QTimer(self)
        self._timer.setInterval(REFRESH_MS)
        self._timer.timeout.connect(self.show_states)
        self.closed.connect(self._timer.stop)

    def initial_focus(self) -> QWidget:
        return self.rows[0].switch

    def preferred_size(self, room: QSize) -> QSize:
        row_width = max(row.minimumSizeHint().width() for row in self.rows)
        min_width = row_width + 2 + 2 * SIDE_MARGIN + SCROLL_BAR_WIDTH
        width = min(room.width(), max(round(self.theme.scaled(WIDTH)), min_width))
        content_width = width - 2 - 2 * SIDE_MARGIN - SCROLL_BAR_WIDTH
        height = self.introduction.heightForWidth(content_width)
        # measured per row, because layout items are updated late after a change of text
        height += sum(row.height_for(content_width) + 1 + 2 * GAP for row in self.rows)
        return QSize(width, min(room.height(), height + self._header.sizeHint().height() + 14 + 10 + 16 + 4))

    def open(self) -> None:
        """Open the sheet and update the states until it is closed."""
        for row in self.rows:
            row.show_setting()
        self.show_states()
        self._timer.start()
        super().open()

    def dismiss(self) -> None:
        """Apply changed addresses and close the sheet."""
        for row in self.rows:
            row.apply()
        super().dismiss()

    def show_states(self) -> None:
        """Update the displayed states of all networks."""
        for row in self.rows:
            row.show_state()


class NetworkRow(QWidget):
    """Row with the switch, the address and the state of a network.

    `changed` is emitted when the text of the state changes, which can change the row's height.
    """

    changed = Signal()

    def __init__(self, theme: Theme, network: OtherNetwork, networks: Networks) -> None:
        super().__init__()
        self._network, self._networks = network, networks
        kind = network.kind
        self.switch = Switch(theme, kind.product_name)
        self.switch.setMinimumWidth(round(theme.scaled(SWITCH_WIDTH)))
        address_label = _(kind.address_label)
        self.address = AddressField(
            theme, f"{kind.product_name}: {address_label}", kind.default_address, self.apply
        )
        caption = label(address_label, "small", role="textTertiary")
        self.state = label("", "small", role="textSecondary", wrap=True)
        self._error = ""
        above = QHBoxLayout()
        above.setSpacing(10)
        above.addWidget(self.switch)
        above.addStretch(1)
        above.addWidget(caption)
        above.addWidget(self.address)
        self._lines = QVBoxLayout(self)
        self._lines.setContentsMargins(0, 0, 0, 0)
        self._lines.setSpacing(4)
        self._lines.addLayout(above)
        self._lines.addWidget(self.state)
        self.switch.clicked.connect(self._on_toggled)
        self.address.editingFinished.connect(self.apply)

    def height_for(self, width: int) -> int:
        """Return the height in px that the row needs at a width in px."""
        self._lines.invalidate()
        return self._lines.totalHeightForWidth(width)

    def show_setting(self) -> None:
        """Update the switch and the address to the saved settings."""
        network = self._network
        self.switch.setChecked(network.is_selected)
        if network.is_selected:
            self.address.setText(network.address)
        self._show_error("")

    def show_state(self) -> None:
        """Update the text of the state, which shows an error if the last change failed."""
        text = self._error or state_text(self._network)
        role = "error" if self._error else "warn" if self._network.state == "lost" else "textSecondary"
        set_role(self.state, role)
        if text != self.state.text():
            self.state.setText(text)
            self.switch.setAccessibleDescription(text)
            self.changed.emit()

    def _on_toggled(self, on: bool) -> None:
        if on:
            self._apply_change(lambda: self._networks.select(self._network.kind.name, self.address.text()))
            self.switch.setChecked(self._network.is_selected)
        else:
            self._apply_change(lambda: self._networks.deselect(self._network.kind.name))

    def apply(self) -> None:
        """Apply the address if it was changed and the network is switched on."""
        network = self._network
        if network.is_selected and self.address.text().strip() != network.address:
            self._apply_change(lambda: self._networks.select(network.kind.name, self.address.text()))

    def _apply_change(self, change: Callable[[], None]) -> None:
        try:
            change()
        except (NepError, SettingsError) as error:
            self._show_error(f"{str(error)[:1].upper()}{str(error)[1:]}.")
        else:
            self._show_error("")
            if self._network.is_selected:
                self.address.setText(self._network.address)

    def _show_error(self, message: str) -> None:
        self._error = message
        self.address.set_invalid(is_invalid=bool(message))
        self.show_state()
        if message:
            paint.announce(self.state, message)


class AddressField(QLineEdit):
    """Text field for an address. Enter applies the address without moving the focus."""

    def __init__(self, theme: Theme, name: str, example: str, callback: Callable[[], object]) -> None:
        super().__init__()
        self._on_submit = callback
        self.setAccessibleName(name)
        self.setPlaceholderText(example)
        self.setProperty("focusRadius", theme.radius("control"))
        self.setMinimumWidth(round(theme.scaled(190)))
        self.setMaxLength(400)
        FieldContextMenu(theme, self)

    def set_invalid(self, *, is_invalid: bool) -> None:
        """Show the address as invalid if `is_invalid`, else as valid."""
        set_invalid(self, is_invalid=is_invalid)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._on_submit()
        else:
            super().keyPressEvent(event)


def state_text(network: OtherNetwork) -> str:
    """Return a sentence about the state of a network, or about its address while it is switched off."""
    if network.state == "lost":
        return f"{network.sentence[:1].upper()}{network.sentence[1:]}."
    if network.state == "looking":
        return _("Searching…")
    if network.state == "off":
        return _(network.kind.hint)
    topics, nodes = len(network.topics), len(network.nodes)
    return _("Connected: {topics}, {nodes}.").format(
        topics=ngettext("{count} topic", "{count} topics", topics).format(count=group_digits(topics)),
        nodes=ngettext("{count} node", "{count} nodes", nodes).format(count=group_digits(nodes)),
    )
