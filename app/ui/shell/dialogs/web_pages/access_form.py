"""Form for access to the web server: address, token, network interface and QR code."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.core.network.web_pages import WebPages
from app.core.network.web_texts import address_text
from app.ui.shell.dialogs.web_pages.fields import CopyField
from app.ui.shell.dialogs.web_pages.qr_code import SIDE, QrCode
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, IconButton, Segments, label, set_role
from app.ui.widgets.labels import IconLabel
from nep.i18n import _
from nep.system.addresses import OwnAddress

LABEL_WIDTH = 80
_MAX_SEGMENTS = 2
_MASK = "•••• •••• {end}"
_VISIBLE_CHARS = 4


class AddressChoice(QWidget):
    """Input for the address at which the server can be reached.

    `selected` is emitted with an address of this computer, or with "" for this computer only.
    """

    selected = Signal(str)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(0, 0, 0, 0)
        self._choice: Segments | ComboBox | None = None
        self._hosts: tuple[str, ...] = ()

    def set_addresses(self, addresses: Sequence[OwnAddress], value: str) -> None:
        """Set the available addresses and select one of them.

        Args:
            addresses: Addresses of this computer.
            value: Address to select, or "" for this computer only.
        """
        if value and value not in {
            address.host for address in addresses
        }:  # the computer no longer has this address
            addresses = (*addresses, OwnAddress(value, ""))
        options: list[tuple[str, str, str | None]] = [("", _("This computer"), None)]
        options += [(address.host, address_text(address), None) for address in addresses]
        if self._choice is not None:
            self._row.removeWidget(self._choice)
            self._choice.deleteLater()
        if len(options) <= _MAX_SEGMENTS:
            segments = Segments(self._theme, options, value, check=True, name=_("Available on"), wraps=True)
            segments.changed.connect(self.selected)
            self._choice = segments
        else:
            combo = ComboBox(
                self._theme, [(host, text) for host, text, _icon in options], name=_("Available on")
            )
            combo.set_value(value)
            combo.activated.connect(lambda _index: self.selected.emit(combo.value))
            self._choice = combo
        self._row.addWidget(self._choice)
        if isinstance(self._choice, Segments):
            self._row.addStretch(1)

    @property
    def value(self) -> str:
        """Selected address, or "" for this computer only."""
        return "" if self._choice is None else self._choice.value

    def set_value(self, value: str) -> None:
        """Select an address without emitting `selected`."""
        if self._choice is not None:
            self._choice.set_value(value)

    @property
    def input_widget(self) -> QWidget | None:
        """Input widget, which can get the focus, or None before the first `set_addresses`."""
        return self._choice


class AccessForm(QWidget):
    """First part of the form. Signals request changes of the settings; `show_state` shows the result."""

    copy_address_requested = Signal()
    copy_token_requested = Signal()
    new_token_requested = Signal()

    def __init__(self, theme: Theme, web: WebPages) -> None:
        super().__init__()
        self._theme, self._web = theme, web
        self.address = CopyField(theme, _("Address"), _("Copy the address"))
        self.reveal = IconButton(theme, "eye", _("Show the token"), checkable=True, size=26)
        self.token = CopyField(theme, _("Token"), _("Copy the token"), self.reveal)
        self.new_token = Button(theme, _("New"), "refresh-cw")
        self.address_choice = AddressChoice(theme)
        self.reach_icon = IconLabel(theme, "lock", side=14)
        self.reach_icon.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
        self.reach_icon.setContentsMargins(0, 2, 0, 2)
        self.reach = label("", "small", wrap=True)
        self.works_with = label("", "small", role="textTertiary", wrap=True)
        self.qr = QrCode(theme)
        self.qr_caption = label("", "small", role="textSecondary", wrap=True)
        self.qr_caption.setAlignment(Qt.AlignmentFlag.AlignHCenter | Qt.AlignmentFlag.AlignTop)
        self.address.copy_requested.connect(self.copy_address_requested)
        self.token.copy_requested.connect(self.copy_token_requested)
        self.new_token.clicked.connect(self.new_token_requested)
        self.reveal.toggled.connect(self._show_token)
        self._lay_out()

    def _lay_out(self) -> None:
        token = QHBoxLayout()
        token.setSpacing(8)
        token.addWidget(self.token, 1)
        token.addWidget(self.new_token)
        reach_row = QHBoxLayout()
        reach_row.setSpacing(6)
        reach_row.addWidget(self.reach_icon, 0, Qt.AlignmentFlag.AlignTop)
        reach_row.addWidget(self.reach, 1)
        reach_column = QVBoxLayout()
        reach_column.setSpacing(2)
        reach_column.addLayout(reach_row)
        reach_column.addWidget(self.works_with)
        reach_column.addStretch(1)
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(10)
        grid.setVerticalSpacing(8)
        grid.setColumnStretch(1, 1)
        for row, text in enumerate((_("Address"), _("Token"), _("Available on"))):
            grid.addWidget(label(text, "body", role="textSecondary", wrap=True), row, 0)
        grid.addWidget(self.address, 0, 1)
        grid.addLayout(token, 1, 1)
        grid.addWidget(self.address_choice, 2, 1)
        grid.addLayout(reach_column, 3, 1)
        code = QVBoxLayout()
        code.setSpacing(6)
        code.addWidget(self.qr, 0, Qt.AlignmentFlag.AlignHCenter)
        code.addWidget(self.qr_caption)
        code.addStretch(1)
        grid.addLayout(code, 0, 2, 4, 1)
        self._theme.changed.connect(self._update_widths)
        self._update_widths()

    def _update_widths(self) -> None:
        self._grid.setColumnMinimumWidth(0, round(self._theme.scaled(LABEL_WIDTH)))
        self.qr_caption.setFixedWidth(round(self._theme.scaled(SIDE)))

    def show_state(self, *, is_foxglove: bool) -> None:
        """Update the address of the server, its token, and the description of who can reach it.

        Args:
            is_foxglove: True to show the server for Foxglove, False to show the one for rosbridge.
        """
        web = self._web
        self.address.show_text(web.url)
        self._show_token()
        self.new_token.setEnabled(bool(web.token))
        self.reveal.setEnabled(bool(web.token))
        if self.address_choice.value != web.host:
            self.address_choice.set_value(web.host)
        self._show_reach(is_foxglove=is_foxglove)
        self._show_qr_code(is_foxglove=is_foxglove)

    def _show_token(self) -> None:
        token = self._web.token
        text = token if self.reveal.isChecked() else _MASK.format(end=token[-_VISIBLE_CHARS:])
        self.token.show_text(text if token else _("not needed on this computer"), can_copy=bool(token))
        self.reveal.set_icon("eye-off" if self.reveal.isChecked() else "eye")
        self.reveal.set_name(_("Hide the token") if self.reveal.isChecked() else _("Show the token"))

    def _show_reach(self, *, is_foxglove: bool) -> None:
        host = self._web.host
        role = "warn" if host else "textSecondary"
        self.reach_icon.set_icon("wifi" if host else "lock", role)
        set_role(self.reach, role)
        text = _("Other devices can't reach this address.")
        if host:
            text = _("Devices on the network of {address} can reach this address. Messages aren't encrypted.")
        self.reach.setText(text.format(address=host))
        self.works_with.setText(
            _("Port, token, origins and robots are the same as for rosbridge.")
            if is_foxglove
            else _("Works with roslib, roslibpy and your own pages.")
        )

    def _show_qr_code(self, *, is_foxglove: bool) -> None:
        web = self._web
        if is_foxglove:
            self.qr.show_message(
                _("Copy the link below. In Foxglove or Lichtblick: Open connection, Foxglove WebSocket.")
            )
        elif not web.host:
            self.qr.show_message(
                _("To scan a code with a tablet, select a network address instead of “This computer”.")
            )
        elif web.state != "on" or "rosbridge" not in web.protocols:
            self.qr.show_message(_("The code appears here once web pages can connect."))
        else:
            self.qr.show_code(web.page_url, web.host_and_port)
        self.qr_caption.setText(_("Scan with the tablet") if self.qr.text else "")
