"""Sheet for web pages and tablets: switches the web server, sets its access, and lists connected pages."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtGui import QGuiApplication, QKeyEvent
from PySide6.QtWidgets import (
    QFrame,
    QGridLayout,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QScrollArea,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.core.network.web_pages import WebPages
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.dates import clock_words
from app.ui.text.numbers import grouped
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Switch, label, paint, set_role
from app.ui.widgets.inputs.combo_box import ComboBox
from app.ui.widgets.menus import EditMenu
from nep.errors import NepError
from nep.i18n import _, ngettext

WIDE, HIGH = 640, 664
_SIDE, _SCROLL_BAR, _MIN_LIST_HIGH = 19, 10, 120
REFRESH_MS = 300
_NO_PORT = 65535
_ID = Qt.ItemDataRole.UserRole


class WebPagesSheet(Overlay):
    """Changes apply at once: a running server is restarted."""

    top = 56

    def __init__(
        self, theme: Theme, window: QWidget, web: WebPages, robots: Callable[[], tuple[str, ...]]
    ) -> None:
        """``robots`` returns the names of connected robots."""
        super().__init__(theme, window, _("Web pages and tablets"))
        self._web, self._robots = web, robots
        self.switch = Switch(theme, _("Let web pages connect"))
        self.state = label("", "body", role="textSecondary", wrap=True)
        self.other_port = Button(theme, "", size="small")
        self.address = _field(theme, _("Address"), is_fixed=True)
        self.copy_address = IconButton(theme, "copy", _("Copy the address"))
        self.token = _field(theme, _("Token"), is_fixed=True)
        self.copy_token = IconButton(theme, "copy", _("Copy the address with the token"))
        self.new_token = Button(theme, _("New"), "refresh-cw", size="small")
        self.open_to = ComboBox(theme, name=_("Open to"))
        self.reach = label("", "small", role="textTertiary", wrap=True)
        self.origins = _field(theme, _("Origins"))
        self.origins.setPlaceholderText("http://192.168.1.20:8080")
        self.origins_state = label("", "small", role="textTertiary", wrap=True)
        self.robots = _field(theme, _("Robots"))
        self.robots.setPlaceholderText(_("none"))
        self.robots_state = label("", "small", role="textTertiary", wrap=True)
        self.heading = label(_("Connected pages"), "bodyLarge")
        self.list = QTreeWidget()
        self.empty = label("", "body", role="textSecondary", wrap=True)
        self.empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.disconnect_page = Button(theme, _("Disconnect"), "x", size="small")
        self.refused = label("", "body", role="error", wrap=True)
        self.allow = Button(theme, _("Allow it"), size="small")
        self._shown: object = None
        self._wrong_origins = self._refused_origin = ""
        self._set_up_list()
        self._lay_out()
        self._connect()
        self._timer = QTimer(self)
        self._timer.setInterval(REFRESH_MS)
        self._timer.timeout.connect(self.refresh)
        self.closed.connect(self._timer.stop)

    def _set_up_list(self) -> None:
        tree = self.list
        tree.setAccessibleName(_("Connected pages"))
        tree.setProperty("raised", "true")
        tree.setFrameShape(QFrame.Shape.NoFrame)
        tree.setUniformRowHeights(True)
        tree.setMinimumHeight(_MIN_LIST_HIGH)
        tree.setHeaderLabels([_("Page and topics"), _("Address"), _("Since"), _("Dropped")])
        tree.header().setHighlightSections(False)
        tree.header().setStretchLastSection(False)
        tree.header().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        for column in (1, 2, 3):
            tree.header().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)

    def _lay_out(self) -> None:
        form = QGridLayout()
        form.setHorizontalSpacing(10)
        form.setVerticalSpacing(6)
        form.setColumnStretch(1, 1)
        rows = (
            (_("Address"), (self.address, self.copy_address), None),
            (_("Token"), (self.token, self.copy_token, self.new_token), None),
            (_("Open to"), (self.open_to,), self.reach),
            (_("Origins"), (self.origins,), self.origins_state),
            (_("Robots"), (self.robots,), self.robots_state),
        )
        for number, (word, widgets, said) in enumerate(rows):
            form.addWidget(label(word, "body", role="textSecondary"), 2 * number, 0)
            form.addLayout(_row(*widgets), 2 * number, 1)
            if said is not None:
                form.addWidget(said, 2 * number + 1, 1)
        inside = QWidget()
        inside.setProperty("bare", "true")
        column = QVBoxLayout(inside)
        column.setContentsMargins(_SIDE, 0, _SIDE, 0)
        column.setSpacing(10)
        column.addWidget(self.switch)
        column.addLayout(_row(self.state, self.other_port))
        column.addLayout(form)
        column.addLayout(_row(self.heading, self.disconnect_page))
        column.addWidget(self.list, 1)
        column.addWidget(self.empty, 1)
        column.addLayout(_row(self.refused, self.allow))
        self._inside_column = column
        self._area = QScrollArea()
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._area.viewport().setAutoFillBackground(False)
        self._area.setWidget(inside)
        head = self.head(label(_("Web pages and tablets"), "heading"))
        head.setContentsMargins(_SIDE, 0, _SIDE, 0)
        whole = QVBoxLayout(self)
        whole.setContentsMargins(1, 14, 1, 16)
        whole.setSpacing(10)
        whole.addLayout(head)
        whole.addWidget(self._area, 1)

    def _connect(self) -> None:
        web = self._web
        self.switch.clicked.connect(lambda on: self._do(web.switch_on if on else web.switch_off))
        self.other_port.clicked.connect(self._use_other_port)
        self.copy_address.clicked.connect(lambda: QGuiApplication.clipboard().setText(web.url))
        self.copy_token.clicked.connect(lambda: QGuiApplication.clipboard().setText(web.full_url))
        self.new_token.clicked.connect(lambda: self._do(web.new_token))
        self.open_to.activated.connect(self._choose_host)
        self.origins.editingFinished.connect(self._take_origins)
        self.robots.editingFinished.connect(self._take_robots)
        self.allow.clicked.connect(self._allow)
        self.disconnect_page.clicked.connect(self._disconnect_chosen)
        self.list.currentItemChanged.connect(lambda *_items: self._show_disconnect())

    def first(self) -> QWidget:
        return self.switch

    def wanted_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        least = self._inside_column.minimumSize().width() + _SCROLL_BAR
        wide = max(round(scaled(WIDE)), least)
        return QSize(min(room.width(), wide), min(room.height(), round(scaled(HIGH))))

    def open(self) -> None:
        """Open the sheet, which follows the server until it is closed."""
        self.open_to.clear()
        self.open_to.addItem(_("This computer"), "")
        for own in self._web.addresses():
            self.open_to.addItem(f"{own.host} ({own.interface})", own.host)
        self.open_to.setCurrentIndex(max(0, self.open_to.findData(self._web.host)))
        self.origins.setText(" ".join(self._web.origins))
        self.robots.setText(", ".join(self._web.robots))
        self.refresh()
        self._timer.start()
        super().open()

    def refresh(self) -> None:
        """Show the server's state and its pages."""
        web = self._web
        self.switch.setChecked(web.state != "off")
        self._show_state()
        self.address.setText(web.url)
        self.token.setText(f"•••• •••• {web.token[-4:]}" if web.token else _("not needed on this computer"))
        for widget in (self.copy_token, self.new_token):
            widget.setEnabled(bool(web.token))
        self._show_who_may()
        self._show_pages()
        self._show_refusal()

    # ---- contents

    def _show_state(self) -> None:
        web = self._web
        words = web.sentence or {
            "off": _("Off at each start of Studio."),
            "starting": _("Starting."),
            "on": _("Works with roslib, roslibpy and pages of your own."),
        }.get(web.state, "")
        set_role(self.state, "error" if web.sentence else "textSecondary")
        if words != self.state.text():
            self.state.setText(words)
            self.switch.setAccessibleDescription(words)
        self.other_port.set_word(_("Use {port}").format(port=min(web.port + 1, _NO_PORT)))
        paint.show_when(self.other_port, web.is_port_taken)

    def _show_who_may(self) -> None:
        web = self._web
        set_role(self.reach, "warn" if web.host else "textTertiary")
        self.reach.setText(
            _("Devices in this network can reach the address. Messages travel unencrypted.")
            if web.host
            else _("Other devices can't reach this address. Choose one of this computer's to open it.")
        )
        set_role(self.origins_state, "error" if self._wrong_origins else "textTertiary")
        self.origins_state.setText(
            self._wrong_origins or _("Pages from other origins are refused. Programs need only the token.")
        )
        set_role(self.robots_state, "warn" if web.robots else "textTertiary")
        names = ", ".join(self._robots())
        said = _("Pages can read topics and publish their own. Moving a robot needs its name here.")
        if names:
            said = _(
                "Pages can read topics and publish their own. Moving a robot needs its name here. "
                "Connected: {robots}."
            ).format(robots=names)
        self.robots_state.setText(said)

    def _show_pages(self) -> None:
        pages = self._web.pages
        paint.show_when(self.list, bool(pages))
        paint.show_when(self.empty, not pages)
        self.empty.setText(
            _("No pages yet. Open a page that connects to the address above.")
            if self._web.state == "on"
            else _("Let web pages connect to see them here.")
        )
        if pages == self._shown:
            return
        self._shown = pages
        said = ngettext("{count} page is connected", "{count} pages are connected", len(pages))
        self.heading.setText(said.format(count=grouped(len(pages))) if pages else _("Connected pages"))
        chosen = self._chosen_id()
        self.list.clear()
        for page in pages:
            since = clock_words(dt.datetime.fromtimestamp(page.since_s).astimezone())
            origin = page.origin or page.name
            item = QTreeWidgetItem([origin, page.address, since, grouped(page.dropped_count)])
            item.setData(0, _ID, page.id)
            item.setTextAlignment(3, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            item.addChildren(
                [QTreeWidgetItem([_("reads {topic}").format(topic=each)]) for each in page.subscribed]
                + [QTreeWidgetItem([_("publishes {topic}").format(topic=each)]) for each in page.published]
            )
            self.list.addTopLevelItem(item)
            if page.id == chosen:
                self.list.setCurrentItem(item)
        self.list.expandAll()
        self._show_disconnect()

    def _show_disconnect(self) -> None:
        self.disconnect_page.setEnabled(self._chosen_id() is not None)

    def _show_refusal(self) -> None:
        refusals = self._web.refusals
        paint.show_when(self.refused, bool(refusals))
        newest = refusals[-1] if refusals else None
        self._refused_origin = "" if newest is None else newest.origin
        paint.show_when(self.allow, bool(self._refused_origin))
        if newest is None:
            return
        clock = clock_words(dt.datetime.fromtimestamp(newest.time_s).astimezone())
        if newest.origin:
            said = _("{origin} was refused at {time}. Its origin isn't allowed.")
            self.refused.setText(said.format(origin=newest.who, time=clock))
        else:
            said = _("{address} was refused at {time}: {reason}.")
            self.refused.setText(said.format(address=newest.who, time=clock, reason=newest.reason))

    # ---- actions of the user

    def _do(self, change: Callable[[], None]) -> None:
        change()
        self.refresh()

    def _use_other_port(self) -> None:
        self._web.port = min(self._web.port + 1, _NO_PORT)
        self._do(self._web.switch_on)

    def _choose_host(self, _index: int) -> None:
        if self.open_to.value != self._web.host and self.open_to.currentIndex() >= 0:
            self._web.host = str(self.open_to.currentData())
            self._do(self._web.apply)

    def _take_origins(self) -> None:
        before = self._web.origins
        try:
            self._web.set_origins(self.origins.text())
            self._wrong_origins = ""
        except NepError:
            self._wrong_origins = _("An origin looks like http://192.168.1.20:8080.")
        _mark(self.origins, is_wrong=bool(self._wrong_origins))
        if self._web.origins != before:
            self._web.apply()
        self.refresh()

    def _take_robots(self) -> None:
        names = [each.strip() for each in self.robots.text().split(",") if each.strip()]
        if tuple(dict.fromkeys(names)) != self._web.robots:
            self._web.set_robots(names)
            self._do(self._web.apply)

    def _allow(self) -> None:
        if self._refused_origin:  # as shown: another page may have been refused since
            self.origins.setText(" ".join((*self._web.origins, self._refused_origin)))
            self._take_origins()

    def _chosen_id(self) -> int | None:
        item = self.list.currentItem()
        while item is not None and item.parent() is not None:
            item = item.parent()
        return None if item is None else item.data(0, _ID)

    def _disconnect_chosen(self) -> None:
        chosen = self._chosen_id()
        if chosen is not None:
            self._web.disconnect(chosen)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Delete and self.list.hasFocus():
            self._disconnect_chosen()
            event.accept()
        else:
            super().keyPressEvent(event)


def _field(theme: Theme, name: str, *, is_fixed: bool = False) -> QLineEdit:
    field = QLineEdit()
    field.setAccessibleName(name)
    field.setReadOnly(is_fixed)
    field.setProperty("focusRadius", theme.radius("control"))
    field.setMaxLength(2_000)
    EditMenu(theme, field)
    return field


def _mark(field: QLineEdit, *, is_wrong: bool) -> None:
    field.setProperty("wrong", "true" if is_wrong else "false")
    field.style().unpolish(field)
    field.style().polish(field)


def _row(first: QWidget, *others: QWidget) -> QHBoxLayout:
    row = QHBoxLayout()
    row.setSpacing(8)
    row.addWidget(first, 1)
    for each in others:
        row.addWidget(each)
    return row
