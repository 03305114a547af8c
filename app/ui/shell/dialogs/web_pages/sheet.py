"""Sheet of the web server, docked at the right of the window: switches and connected pages."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QPoint, QRect, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QScrollArea, QVBoxLayout, QWidget

from app.core.network.web_pages import WebPages, WebProtocol
from app.core.network.web_texts import notices, page_name, terminal_command
from app.ui.other_programs import open_externally
from app.ui.panels.base import ShowToast
from app.ui.shell.dialogs.overlay import STOP_GAP, Overlay, stop_buttons_in
from app.ui.shell.dialogs.web_pages.access_form import AccessForm
from app.ui.shell.dialogs.web_pages.notice_strip import NoticeStrip
from app.ui.shell.dialogs.web_pages.page_model import PageTreeModel, sorted_topics
from app.ui.shell.dialogs.web_pages.page_tree import PageTree
from app.ui.shell.dialogs.web_pages.permissions_form import PermissionForm
from app.ui.text.numbers import bandwidth_text, group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Chip,
    ElidedLabel,
    IconButton,
    Segments,
    Separator,
    Switch,
    label,
    paint,
    set_role,
)
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.keyboard import tab_stops_of
from app.ui.widgets.labels import IconLabel
from nep.i18n import _, ngettext

WIDTH = 640
REFRESH_MS = 300
_SIDE_MARGIN, _TABLE_MARGIN, _SCROLL_BAR_WIDTH, _EDGE_MARGIN, _TOP_PX = 19, 12, 10, 6, 46
_MIN_TABLE_HEIGHT = 120


class WebPagesSheet(Overlay):
    """Sheet of the web server. It has no scrim and stays open while the user works in the window.

    Changes are applied immediately.
    """

    top = _TOP_PX
    is_docked_right = True

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        web: WebPages,
        robots: Callable[[], tuple[str, ...]],
        show_toast: ShowToast,
        open_url: Callable[[QUrl], bool] = open_externally,
    ) -> None:
        # `robots` returns the names of connected robots; `open_url` opens a page in the browser.
        super().__init__(theme, window, _("Web pages and tablets"))
        self._web, self._show_toast, self._open_url = web, show_toast, open_url
        self._dismissed_keys: set[tuple[str, ...]] = set()
        self._tab_order: list[QWidget] = []
        self.access = AccessForm(theme, web)
        self.permissions = PermissionForm(theme, web, robots)
        self._create_header()
        self._create_table()
        self._create_footer()
        self._lay_out()
        self._connect()
        self._timer = QTimer(self)
        self._timer.setInterval(REFRESH_MS)
        self._timer.timeout.connect(self.refresh)
        self.closed.connect(self._timer.stop)

    def _create_header(self) -> None:
        theme = self.theme
        self.count = Chip(theme)
        options = [("rosbridge", "rosbridge", None), ("foxglove", "Foxglove", None)]
        self.tabs = Segments(theme, options, "rosbridge", check=True, name=_("Protocol"), has_dots=True)
        self.switch = Switch(theme, "")
        self.state = label("", "body", role="textTertiary", wrap=True)
        self.other_port = Button(theme, "", size="small")

    def _create_table(self) -> None:
        self.heading = label(_("Connected pages"), "title")
        self.totals = label("", "body", role="textTertiary")
        self.model = PageTreeModel(self)
        self.table = PageTree(self.theme, self.model)
        self.table.setMinimumHeight(_MIN_TABLE_HEIGHT)
        self.empty = label("", "body", role="textSecondary", wrap=True)
        self.empty.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.empty.setMinimumHeight(_MIN_TABLE_HEIGHT // 2)
        self.notice = NoticeStrip(self.theme)

    def _create_footer(self) -> None:
        theme = self.theme
        self.command = ElidedLabel("code", "text", min_width=round(theme.scaled(90)))
        self.command.mode = Qt.TextElideMode.ElideRight
        self.copy_command = IconButton(theme, "copy", _("Copy the command"), size=26)
        self.copy_page = Button(theme, "", "copy")
        self.test_page = Button(theme, _("Open the test page"), "external-link", kind="primary")

    def _lay_out(self) -> None:
        self._content = QWidget()
        self._content.setProperty("bare", "true")
        column = QVBoxLayout(self._content)
        column.setContentsMargins(0, 2, 0, 6)
        column.setSpacing(0)
        column.addLayout(self._form())
        column.addSpacing(12)
        column.addWidget(Separator(self.theme))
        column.addSpacing(8)
        column.addLayout(self._table_part(), 1)
        self._area = QScrollArea()
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._area.viewport().setAutoFillBackground(False)
        self._area.setWidget(self._content)
        notice = QHBoxLayout()
        notice.setContentsMargins(_TABLE_MARGIN, 0, _TABLE_MARGIN, 0)
        notice.addWidget(self.notice)
        outer_column = QVBoxLayout(self)
        outer_column.setContentsMargins(1, 10, 1, 8)
        outer_column.setSpacing(8)
        outer_column.addLayout(self._header_row())
        outer_column.addWidget(self._area, 1)
        outer_column.addLayout(notice)
        outer_column.addWidget(Separator(self.theme))
        outer_column.addLayout(self._footer_row())

    def _header_row(self) -> QHBoxLayout:
        title = QWidget()
        row = Flow(title, gap=10)
        row.addWidget(IconLabel(self.theme, "globe", side=20))
        row.addWidget(label(_("Web pages and tablets"), "heading", wrap=True))
        row.addWidget(self.count)
        header = self.create_header(title)
        header.setContentsMargins(_SIDE_MARGIN, 0, 10, 0)
        return header

    def _form(self) -> QVBoxLayout:
        switches = Flow(gap=12)
        switches.addWidget(self.switch)
        switches.addWidget(self.state)
        switches.addWidget(self.other_port)
        switches.push()
        switches.addWidget(self.tabs)
        form = QVBoxLayout()
        form.setContentsMargins(_SIDE_MARGIN, 0, _SIDE_MARGIN, 0)
        form.setSpacing(10)
        form.addLayout(switches)
        form.addWidget(self.access)
        form.addWidget(self.permissions)
        return form

    def _table_part(self) -> QVBoxLayout:
        heading = QHBoxLayout()
        heading.setContentsMargins(_SIDE_MARGIN - _TABLE_MARGIN, 0, _SIDE_MARGIN - _TABLE_MARGIN, 0)
        heading.setSpacing(8)
        heading.addWidget(self.heading)
        heading.addWidget(self.totals, 1)
        part = QVBoxLayout()
        part.setContentsMargins(_TABLE_MARGIN, 0, _TABLE_MARGIN, 0)
        part.setSpacing(4)
        part.addLayout(heading)
        part.addWidget(self.table, 1)
        part.addWidget(self.empty, 1)
        self.empty.setContentsMargins(_SIDE_MARGIN - _TABLE_MARGIN, 4, 0, 0)
        return part

    def _footer_row(self) -> Flow:
        footer = Flow(gap=8)
        footer.setContentsMargins(_SIDE_MARGIN, 0, _SIDE_MARGIN - 7, 0)
        footer.addWidget(label(_("In a terminal:"), "small", role="textSecondary"))
        footer.add_elastic(self.command, is_greedy=True)
        footer.addWidget(self.copy_command)
        footer.addWidget(self.copy_page)
        footer.addWidget(self.test_page)
        return footer

    def _connect(self) -> None:
        access, table = self.access, self.table
        self.tabs.changed.connect(lambda _tab: self.refresh())
        self.switch.clicked.connect(
            lambda on: self._apply(partial(self._web.set_protocol_enabled, self._selected_protocol, on=on))
        )
        self.other_port.clicked.connect(lambda: self._apply(self._web.use_free_port))
        access.copy_address_requested.connect(self._copy_address)
        access.copy_token_requested.connect(lambda: self._copy(self._web.token, _("Copied the token")))
        access.new_token_requested.connect(self._replace_token)
        access.address_choice.selected.connect(lambda host: self._apply(partial(self._web.listen_on, host)))
        self.permissions.robots.changed.connect(self.refresh)
        self.permissions.origins.editing_finished.connect(self.refresh)
        table.disconnect_requested.connect(self._disconnect)
        table.copy_requested.connect(lambda text: self._copy(text, _("Copied {text}").format(text=text)))
        self.notice.fix_requested.connect(self._fix_notice)
        self.notice.dismissed.connect(self._dismiss)
        self.copy_command.clicked.connect(
            lambda: self._copy(terminal_command(self._web), _("Copied the command"))
        )
        self.copy_page.clicked.connect(self._copy_page)
        self.test_page.clicked.connect(lambda: self._open_url(QUrl(self._web.local_page_url)))

    def initial_focus(self) -> QWidget:
        return self.switch

    def preferred_size(self, room: QSize) -> QSize:
        min_width = self._content.minimumSizeHint().width() + _SCROLL_BAR_WIDTH
        return QSize(min(room.width(), max(round(self.theme.scaled(WIDTH)), min_width)), room.height())

    def _geometry_at(self, top: int) -> QRect:
        window = self.covered_window()
        bottom = window.height() - _EDGE_MARGIN
        for bar in window.findChildren(QWidget, "statusBar"):
            if bar.isVisible():
                bottom = min(bottom, bar.mapTo(window, QPoint()).y() - _EDGE_MARGIN)
        for stop in stop_buttons_in(window):  # Stop buttons at the right end of a bar would overlap the sheet
            top = max(top, stop.mapTo(window, QPoint()).y() + stop.height() + STOP_GAP)
        size = self.preferred_size(QSize(window.width() - 2 * _EDGE_MARGIN, max(1, bottom - top)))
        return QRect(QPoint(window.width() - size.width() - _EDGE_MARGIN, top), size)

    def place(self) -> None:
        super().place()
        self._scrim.hide()

    def _focus_changed(self, _old: QWidget | None, _new: QWidget | None) -> None:
        return  # the sheet stays open while the user works in the window

    def open(self) -> None:
        """Open the sheet and update it until it is closed."""
        self.access.address_choice.set_addresses(self._web.addresses(), self._web.host)
        if self._selected_protocol not in self._web.protocols and self._web.protocols:
            self.tabs.set_value(next(iter(self._web.protocols)))
        self.refresh()
        self._timer.start()
        super().open()
        self._scrim.hide()

    @property
    def _selected_protocol(self) -> WebProtocol:
        return "foxglove" if self.tabs.value == "foxglove" else "rosbridge"

    def refresh(self) -> None:
        """Update the sheet to the state of the server and the connected pages."""
        web, is_foxglove = self._web, self._selected_protocol == "foxglove"
        web.refresh()
        self._show_switch()
        self.access.show_state(is_foxglove=is_foxglove)
        self.permissions.show_state()
        self._show_pages()
        self.notice.show_notices(notices(web, self._dismissed_keys))
        self.command.setText(terminal_command(web))
        self.copy_page.set_label(_("Copy the link") if is_foxglove else _("Copy a starter page"))
        paint.show_when(self.test_page, not is_foxglove)
        self._set_tab_order()
        self.test_page.setEnabled(web.state == "on")

    def _show_switch(self) -> None:
        web, is_foxglove = self._web, self._selected_protocol == "foxglove"
        text = _("Let Foxglove and Lichtblick connect") if is_foxglove else _("Let web pages connect")
        if text != self.switch.text():
            self.switch.set_text(text)
            self.switch.updateGeometry()
        self.switch.setChecked(self._selected_protocol in web.protocols)
        for protocol in ("rosbridge", "foxglove"):
            self.tabs.set_dot(protocol, protocol in web.protocols and web.state == "on")
        idle_text = "" if is_foxglove else _("Always off when Studio starts")
        status_text = web.sentence or (_("Starting…") if web.state == "starting" else idle_text)
        set_role(self.state, "error" if web.sentence else "textTertiary")
        if status_text != self.state.text():
            self.state.setText(status_text)
            paint.show_when(self.state, bool(status_text))
            self.switch.setAccessibleDescription(status_text)
        if web.free_port:
            self.other_port.set_label(_("Use {port}").format(port=web.free_port))
        paint.show_when(self.other_port, bool(web.free_port))

    def _show_pages(self) -> None:
        web = self._web
        pages, count = web.listed_pages, len(web.connected)
        self.model.show_pages([sorted_topics(each) for each in pages])
        text = ngettext("{count} connected", "{count} connected", count).format(count=group_digits(count))
        self.count.set(text if count else "", "ok")
        totals = _("{count}, {bandwidth} in total").format(
            count=group_digits(count), bandwidth=bandwidth_text(web.bytes_per_s)
        )
        self.totals.setText(totals if count else "")
        paint.show_when(self.table, bool(pages))
        paint.show_when(self.empty, not pages)
        if web.state == "on":
            text = (
                _("No pages yet. Scan the code with a tablet, or open the test page.")
                if self.access.qr.text
                else _("No pages yet. Open the test page, or a page that connects to the address above.")
            )
        else:
            text = _("Let web pages connect to see them here.")
        self.empty.setText(text)

    def _set_tab_order(self) -> None:
        # Sets the tab order to the reading order; Qt would append widgets that are created later.
        access, origins = self.access, self.permissions.origins
        parts = (
            self.switch, self.other_port, self.tabs, access.address, access.token, access.new_token,
            access.address_choice, *origins.tokens, origins.edit, self.permissions.robots, self.table,
            self.notice, self.copy_command, self.copy_page, self.test_page,
        )  # fmt: skip
        stops = [stop for part in parts for stop in tab_stops_of(part)]
        if stops != self._tab_order:
            self._tab_order = stops
            for before, after in itertools.pairwise(stops):
                QWidget.setTabOrder(before, after)

    def _apply(self, change: Callable[[], object]) -> None:
        change()
        self.refresh()

    def _copy(self, text: str, message: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self._show_toast(message)

    def _copy_address(self) -> None:
        self._copy(self._web.url, _("Copied the address"))

    def _copy_page(self) -> None:
        if self._selected_protocol == "foxglove":
            self._copy(self._web.full_url, _("Copied the link"))
        else:
            message = _("Copied a starter page. Paste it into a file such as page.html.")
            self._copy(self._web.template_page(), message)

    def _replace_token(self) -> None:
        web, old_token = self._web, self._web.token
        count = web.generate_token()
        self.refresh()
        message = ngettext(
            "New token. {count} page was disconnected.", "New token. {count} pages were disconnected.", count
        )

        def undo() -> None:
            if web.token and web.host:
                self._apply(partial(web.set_token, old_token))

        self._show_toast(
            message.format(count=group_digits(count)) if count else _("New token"), _("Undo"), undo
        )

    def _disconnect(self, page_id: int) -> None:
        page = next((each for each in self._web.connected if each.id == page_id), None)
        if page is None:
            return
        self._web.block_page(page)
        self.refresh()
        message = _("Disconnected {page}. It is now blocked.")
        self._show_toast(
            message.format(page=page_name(page)),
            _("Undo"),
            lambda: self._apply(partial(self._web.unblock_page, page_id)),
        )

    def _fix_notice(self) -> None:
        notice = self.notice.notice
        if notice is None:
            return
        if notice.next_step == "choose robots":
            self._area.ensureWidgetVisible(self.permissions.robots)
            self.permissions.robots.open_list()
        elif notice.next_step == "allow origin":
            self._web.add_origin(notice.value)
        elif notice.next_step == "let in":
            self._web.unblock_page(int(notice.value))
        self.refresh()

    def _dismiss(self) -> None:
        if self.notice.notice is not None:
            self._dismissed_keys.add(self.notice.notice.key)
            self.refresh()
