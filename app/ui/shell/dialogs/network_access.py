"""Sheet to let other computers connect: consequences, address, and the setting for those computers."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.core.network.remote_access import RemoteAccess
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, IconButton, label, paint
from nep.i18n import _, lazy

WIDTH = 520
WARNING = lazy(
    "Anyone on this network will be able to see and control your robots. There is no password: "
    "use a network you trust, never a public one."
)


class NetworkAccessSheet(Overlay):
    """Sheet of the command "Let other computers connect", which the status bar opens too."""

    top = 128

    def __init__(self, theme: Theme, window: QWidget, access: RemoteAccess) -> None:
        super().__init__(theme, window, _("Other computers"))
        self._access = access
        self.heading = label("", "heading", wrap=True)
        self.warning = label("", "bodyLarge", role="textSecondary", wrap=True)
        self.address_row = QHBoxLayout()
        self.address_title = label(_("Network address"), "bodyLarge", role="textSecondary")
        self.choice: ComboBox | None = None
        self.setting_title = label(_("On the other computers, set:"), "body", role="textSecondary")
        self.setting_label = label("", "code")
        self.setting_label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.copy = IconButton(theme, "copy", _("Copy setting"))
        self.copy.clicked.connect(lambda: QGuiApplication.clipboard().setText(self.setting_label.text()))
        self.allow_button = Button(theme, _("Allow connections"), "wifi", kind="primary", size="form")
        self.cancel_button = Button(theme, _("Cancel"), size="form")
        self.revoke_button = Button(theme, _("This computer only"), "lock", size="form")
        self.allow_button.clicked.connect(self._allow_access)
        self.cancel_button.clicked.connect(self.dismiss)
        self.revoke_button.clicked.connect(self._revoke_access)
        self._lay_out()

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 16)
        column.setSpacing(12)
        column.addWidget(self.heading)
        column.addWidget(self.warning)
        self.address_row.addWidget(self.address_title)
        self.address_row.addStretch(1)
        column.addLayout(self.address_row)
        typed = QHBoxLayout()
        typed.setSpacing(8)
        typed.addWidget(self.setting_label)
        typed.addWidget(self.copy)
        typed.addStretch(1)
        column.addWidget(self.setting_title)
        column.addLayout(typed)
        row = QHBoxLayout()
        row.setSpacing(8)
        row.addStretch(1)
        for button in (self.revoke_button, self.cancel_button, self.allow_button):
            row.addWidget(button)
        column.addLayout(row)

    def initial_focus(self) -> QWidget:
        return self.cancel_button

    def preferred_size(self, room: QSize) -> QSize:
        layout = self.layout()
        hint = self.sizeHint()
        width = min(room.width(), max(round(self.theme.scaled(WIDTH)), self.minimumSizeHint().width()))
        height = layout.totalHeightForWidth(width) if layout is not None else hint.height()
        return QSize(width, min(room.height(), height))

    def open(self) -> None:
        """Update the sheet to the current settings and open it."""
        self._show()
        super().open()

    def _show(self) -> None:
        access = self._access
        addresses = access.addresses()
        is_open, can_open = bool(access.hosts), access.is_local and bool(addresses)
        self.heading.setText(self._heading(is_open=is_open, can_open=can_open))
        self.warning.setText(self._message(is_open=is_open, can_open=can_open))
        if self.choice is not None:
            self.address_row.removeWidget(self.choice)
            self.choice.deleteLater()
            self.choice = None
        if can_open and not is_open:
            options = [(address.host, f"{address.host} ({address.interface})") for address in addresses]
            self.choice = ComboBox(self.theme, options, name=_("Address"))
            self.choice.currentIndexChanged.connect(lambda _index: self._show_selected())
            self.address_row.insertWidget(1, self.choice)
        paint.show_when(self.address_title, self.choice is not None)
        self._show_setting(access.hosts[0] if is_open else addresses[0].host if addresses else "")
        for widget in (self.setting_label, self.copy, self.setting_title):
            paint.show_when(widget, is_open or can_open)
        paint.show_when(self.allow_button, can_open and not is_open)
        paint.show_when(self.revoke_button, is_open and access.is_local)
        is_notice = self.allow_button.isHidden() and self.revoke_button.isHidden()
        self.cancel_button.set_label(_("Close") if is_notice else _("Cancel"))
        self.setAccessibleName(f"{self.heading.text()} {self.warning.text()}")

    def _heading(self, *, is_open: bool, can_open: bool) -> str:
        if not self._access.is_local:
            return _("The master is on another computer, {host}").format(host=self._access.master_host)
        if is_open:
            addresses = ", ".join(self._access.hosts)
            return _("Other computers can connect at {addresses}").format(addresses=addresses)
        return (
            _("Let other computers connect?") if can_open else _("This computer isn't connected to a network")
        )

    def _message(self, *, is_open: bool, can_open: bool) -> str:
        if not self._access.is_local:
            return _("Connections are configured on that computer.")
        if is_open or can_open:
            return _(WARNING)
        return _("Join a Wi-Fi network or plug in a cable, then try again.")

    def _show_setting(self, host: str) -> None:
        self.setting_label.setText(self._access.environment_variable(host))

    def _show_selected(self) -> None:
        if self.choice is not None:
            self._show_setting(self.choice.value)

    def _allow_access(self) -> None:
        if self.choice is not None:
            self._access.listen_on((self.choice.value,))
        self.dismiss()

    def _revoke_access(self) -> None:
        self._access.listen_on(())
        self.dismiss()
