"""Services panel: list of services, request, reply and earlier calls."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.run.acting.arming import Target
from app.core.run.acting.calling import MAX_TIMEOUT_S, MIN_TIMEOUT_S, TIMEOUT_S, CallRecord
from app.core.run.acting.json_text import JsonText, format_json, parse_json_text
from app.ui.intents import SelectService
from app.ui.panels.act.armed_strip import ArmDurationMenu, ArmedStrip
from app.ui.panels.act.services.reply_view import ReplyView, clock_text, duration_cell
from app.ui.panels.act.services.request_form import RequestForm
from app.ui.panels.act.services.service_list import ServiceList, count_text, offered_services
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import TabHome
from app.ui.panels.row_actions import RowAction, copy_action, fill_menu
from app.ui.text import plain
from app.ui.text.numbers import seconds_text, tip_with_key
from app.ui.widgets import (
    Button,
    ElidedLabel,
    EmptyAction,
    EmptyState,
    NumberEdit,
    Segments,
    Separator,
    label,
)
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.inputs.json_edit import JsonEdit
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from app.ui.widgets.lists.split_list import ListDetailView
from app.ui.widgets.menus import Menu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.errors import NepError
from nep.i18n import _, lazy
from nep.text import shortened

LIST_WIDTH_PX, SIDE_BY_SIDE_PX, LIST_HEIGHT_PX, SECONDS_WIDTH_PX = 196, 480, 120, 84
MAX_REQUEST_CHARS = 120
EMPTY_REQUEST = "{}"


class ServicesPanel(PanelWidget):
    """Panel with the list of services at the left (at the top if narrow) and the selected service."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Services"))
        self.acting = context.session.acting
        self._last_state: tuple[object, ...] = ()
        self._requested_service = ""
        self._texts: dict[str, str] = {}
        self._shown_service = ""
        self._is_showing = False
        self.count_label = label("", "small", role="textSecondary")
        self.chips = [self.count_label]
        self.strip = ArmedStrip(context)
        self._duration_menu = ArmDurationMenu(self.theme, self, self.acting)
        self.filter = FilterField(self.theme, _("Filter services"))
        self.filter.setMaximumWidth(16_777_215)
        self.list = ServiceList(self.theme)
        self.empty = EmptyState(self.theme, "spline", _("No services available"), "")
        self._make_request()
        self._make_calls()
        self._connect()
        self._arrange()
        self.refresh()

    def _make_request(self) -> None:
        theme = self.theme
        self.name_label = ElidedLabel("code", "text", min_width=60)
        self.format_switch = Segments(
            theme, [("form", _("Form"), None), ("json", _("JSON"), None)], size="small", name=_("Request as")
        )
        self.form = RequestForm(theme)
        self.edit = JsonEdit(theme, _("Request"), min_lines=4)
        self.request_pages = QStackedWidget()
        self.request_pages.addWidget(self.form)
        self.request_pages.addWidget(self.edit)
        self.problem_label = label("", "small", role="error", wrap=True)
        self.problem_label.setMinimumWidth(0)
        self.fix_button = Button(theme, _("Fix it"), "wrench", size="small")
        self.call_button = Button(theme, _("Call"), "play", kind="primary")
        self.call_button.setToolTip(plain.tip(tip_with_key(_("Calls the service"), "Ctrl+Enter")))
        self.cancel_button = Button(theme, _("Cancel"), "x")
        self.timeout_field = NumberEdit(theme, MIN_TIMEOUT_S, MAX_TIMEOUT_S, _("s"), 1)
        self.timeout_field.setAccessibleName(_("Time limit in seconds"))
        self.timeout_field.setFixedWidth(round(theme.scaled(SECONDS_WIDTH_PX)))
        self.timeout_field.show_number(TIMEOUT_S)
        self.timeout_s = TIMEOUT_S

    def _make_calls(self) -> None:
        self.reply_view = ReplyView(self.theme, self.context.show_toast)
        columns: tuple[Column[CallRecord], ...] = (
            Column(
                "at", lazy("Time"), 88, lambda each: Cell(clock_text(each), role="textSecondary", mono=True)
            ),
            Column(
                "request",
                lazy("Request"),
                90,
                _request_cell,
                stretch=True,
                tip=lambda each: each.request[:2000],
            ),
            Column(
                "took", lazy("Duration"), 120, duration_cell, is_numeric=True, tip=lambda each: each.error
            ),
        )
        self.calls_model: TableModel[CallRecord] = TableModel(columns, lambda each: str(each.number))
        self.calls_table = TableView(self.theme, self.calls_model)
        self.calls_table.setAccessibleName(_("Calls"))
        self._clear_action = QAction(_("Clear the call history"), self)
        self._clear_action.triggered.connect(self._clear_calls)

    def _connect(self) -> None:
        self.filter.textChanged.connect(lambda _text: self._rebuild())
        self.filter.exited.connect(lambda: self.list.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self.list.filter_requested.connect(self.focus_filter)
        self.list.selected.connect(lambda _name: self._show_selected())
        self.list.call_requested.connect(self.call)
        self.list.menu_requested.connect(self._show_menu)
        self.format_switch.changed.connect(self._set_mode)
        self.form.typed.connect(self._form_typed)
        self.edit.changed.connect(self._text_typed)
        self.edit.submitted.connect(self.call)
        self.fix_button.clicked.connect(self._apply_fix)
        self.call_button.clicked.connect(self.call)
        self.cancel_button.clicked.connect(self._cancel_call)
        self.timeout_field.number_entered.connect(lambda value: setattr(self, "timeout_s", value))
        self.calls_table.opened.connect(self._open_call)
        self.calls_table.menu_requested.connect(self._show_call_menu)

    def _arrange(self) -> None:
        self._list_detail_view = ListDetailView(
            self.theme,
            (self.filter, self.list, self._make_right_side()),
            list_px=LIST_WIDTH_PX,
            list_height_px=LIST_HEIGHT_PX,
            narrow_px=SIDE_BY_SIDE_PX,
        )
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(self._list_detail_view)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.strip)
        column.addWidget(self.pages, 1)

    def _make_right_side(self) -> QWidget:
        header, fault, buttons = QHBoxLayout(), QHBoxLayout(), Flow(gap=10, row_gap=6)
        header.addWidget(self.name_label, 1)
        header.addWidget(self.format_switch)
        fault.addWidget(self.problem_label, 1)
        fault.addWidget(self.fix_button, 0, Qt.AlignmentFlag.AlignTop)
        for button in (self.call_button, self.cancel_button):
            buttons.addWidget(button)
        timeout_widget = QWidget()
        timeout_row = QHBoxLayout(timeout_widget)
        timeout_row.setContentsMargins(0, 0, 0, 0)
        timeout_row.addWidget(label(_("time limit"), "small", role="textSecondary"))
        timeout_row.addWidget(self.timeout_field)
        buttons.addWidget(timeout_widget)
        self._request_widget = QWidget()
        request = QVBoxLayout(self._request_widget)
        request.setContentsMargins(12, 8, 12, 8)
        request.setSpacing(8)
        request.addLayout(header)
        request.addWidget(self.request_pages, 1)
        request.addLayout(fault)
        request.addLayout(buttons)
        self.reply_view.setMinimumHeight(round(self.theme.scaled(110)))
        self.calls_table.setMinimumHeight(round(self.theme.scaled(90)))
        scroll = ScrollColumn(_("Selected service"))
        scroll.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        for index, (widget, stretch) in enumerate(
            (
                (self._request_widget, 4),
                (Separator(self.theme), 0),
                (self.reply_view, 3),
                (Separator(self.theme), 0),
                (self.calls_table, 2),
            )
        ):
            scroll.column.insertWidget(index, widget)
            scroll.column.setStretch(index, stretch)
        scroll.column.setStretch(scroll.column.count() - 1, 0)  # the reply takes the remaining height
        return scroll

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self.strip.refresh()
        acting, view = self.acting, self.session.live.graph
        graph = (view.epoch, view.revision) if view is not None else None
        state = (
            graph,
            acting.revision,
            acting.calls.revision,
            acting.arming.revision,
            self.session.live.master.kind,
        )
        if state != self._last_state:
            self._last_state = state
            self._rebuild()
        elif acting.calls.in_flight is not None:
            self._update_call()

    def source_changed(self) -> None:
        self._last_state = ()

    def _rebuild(self) -> None:
        services = offered_services(self.session.live.graph)
        keywords = self.filter.text().casefold().split()
        rows = [
            each
            for each in services
            if each.name == self._requested_service
            or all(keyword in f"{each.name} {each.servers_text}".casefold() for keyword in keywords)
        ]
        selected = self._requested_service or self.list.selected_key() or self._shown_service
        self.list.model().set_rows(rows)  # type: ignore[attr-defined]  # always a TableModel
        names = [each.name for each in rows]
        if names:
            target = selected if selected in names else names[0]
            if self.list.selected_key() != target:
                self.list.select_key(target)
            self._requested_service = ""
        self.list.refresh_visible()
        self.count_label.setText(count_text(services))
        self.pages.setCurrentIndex(1 if services else 0)
        if not services:
            self._update_empty_state()
        self._show_selected()

    def _update_empty_state(self) -> None:
        if self.session.live.master.kind == "none":
            self.empty.set_texts(
                _("No master is running"), _("A master lets programs find each other."), "radio-tower"
            )
            start = self.session.launcher.ensure_master
            self.empty.set_actions([EmptyAction(_("Start a master here"), start, "play", is_primary=True)])
        else:
            text = _("Services appear here as soon as a program offers one.")
            self.empty.set_texts(_("No services available"), text, "spline")
            self.empty.set_actions([self.doctor_action()])

    @property
    def service(self) -> str:
        """Name of the selected service, or ""."""
        return self.list.selected_key() or ""

    def _show_selected(self) -> None:
        name = self.service
        if name and name != self._shown_service:
            self._shown_service = name
            self.name_label.setText(name)
            self.form.reset_kinds()
            self._set_text(self._request_text(name))
            self._set_mode("form")
            self.reply_view.show_record(None)
        if name:
            records = [each for each in reversed(self.acting.calls.records) if each.service == name]
            self.calls_model.set_rows(records)
            self.calls_table.refresh_visible()
            self._update_call()

    def _request_text(self, service: str) -> str:
        return self._texts.get(service) or self.acting.saved_messages.requests.get(service, EMPTY_REQUEST)

    @property
    def text(self) -> str:
        """Request as JSON text."""
        return self._texts.get(self._shown_service, EMPTY_REQUEST)

    def _set_text(self, text: str) -> None:
        # Updates the form and the JSON editor.
        self._texts[self._shown_service] = text
        self._is_showing = True
        self.edit.set_text(text)
        parsed = parse_json_text(text)
        if parsed.fault is None and not parsed.placeholders:
            self.form.show_request(parsed.fill({}))
        self._is_showing = False
        self._validate()

    def _can_show_form(self) -> bool:
        parsed = parse_json_text(self.text)
        return parsed.fault is None and not parsed.placeholders and isinstance(parsed.fill({}), Mapping)

    def _validate(self) -> None:
        fault = self._parse_text().fault
        self.edit.mark_line(fault.line if fault is not None else 0)
        message = fault.message if fault is not None else self._problem()
        self.problem_label.setText(message)
        self.problem_label.setVisible(bool(message))
        self.fix_button.setVisible(fault is not None and fault.fix is not None)
        self._update_call()

    def _parse_text(self) -> JsonText:
        return parse_json_text(self.text)

    def _problem(self) -> str:
        # Reason why the request can't be sent although it is valid JSON.
        if self.format_switch.value == "form" and self.form.problems:
            return next(iter(self.form.problems.values()))
        parsed = self._parse_text()
        return (
            _("Fill in “{name}” first.").format(name=parsed.manual_placeholders[0])
            if parsed.manual_placeholders
            else ""
        )

    def _update_call(self) -> None:
        acting, name = self.acting, self.service
        pending_call = acting.calls.in_flight
        is_own_call = pending_call is not None and pending_call.service == name
        can_call = self._parse_text().fault is None and not self._problem() and pending_call is None
        self.call_button.setEnabled(can_call and self.world.is_live)
        is_armed = acting.arming.allows(Target("service", name))
        if is_own_call:
            text = _("Waiting {time}").format(time=seconds_text(acting.calls.elapsed_s))
            self.call_button.set_label(text, "circle-dashed")
        else:
            self.call_button.set_label(
                _("Call") if is_armed else _("Arm and call"), "play" if is_armed else "lock"
            )
        self.cancel_button.setVisible(is_own_call)
        record = self._displayed_record()
        self.reply_view.show_record(record, acting.calls.elapsed_s)

    def _displayed_record(self) -> CallRecord | None:
        records = [each for each in self.acting.calls.records if each.service == self.service]
        selected_key = self.calls_table.selected_key()
        return next(
            (each for each in records if str(each.number) == selected_key), records[-1] if records else None
        )

    # -- user actions -------------------------------------------------------------------------------------

    def open_for(self, service: str) -> None:
        """Select a service and focus the Call button."""
        self._requested_service = service
        self.filter.clear()
        self._rebuild()
        self.call_button.setFocus(Qt.FocusReason.OtherFocusReason)

    def _set_mode(self, mode: str) -> None:
        if mode == "form" and not self._can_show_form():
            mode = "json"  # the request can't be shown as fields
        self.format_switch.set_value(mode)
        self.request_pages.setCurrentIndex(1 if mode == "json" else 0)
        self._validate()

    def _form_typed(self, request: object) -> None:
        if self._is_showing:
            return
        if self.form.problems:
            self._validate()
        else:
            self._set_text(format_json(request))

    def _text_typed(self) -> None:
        if not self._is_showing:
            self._set_text(self.edit.text())

    def _apply_fix(self) -> None:
        fault = self._parse_text().fault
        if fault is not None and fault.fix is not None:
            self.edit.replace(fault.fix.start, fault.fix.end, fault.fix.text)

    def call(self) -> None:
        """Call the selected service."""
        if not self.call_button.isEnabled():
            return
        self.calls_table.clearSelection()
        self.calls_table.setCurrentIndex(self.calls_model.index(-1, -1))
        reason = self.acting.call(self.service, self.text, self.timeout_s)
        if reason:
            self.context.show_toast(reason)
        self.refresh()

    def _cancel_call(self) -> None:
        self.acting.calls.cancel()
        self.refresh()

    def _open_call(self, _key: str) -> None:
        self._update_call()

    def _clear_calls(self) -> None:
        self.acting.calls.clear()
        self.refresh()

    def _show_menu(self, service: str, position: QPoint) -> None:
        menu = fill_menu(Menu(self.theme, self), self.theme, self.service_actions(service))
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.popup(position)

    def service_actions(self, service: str) -> list[RowAction]:
        """Return the context menu actions of a service."""
        return [RowAction(_("Call"), "play", self.call), copy_action(self.context, service)]

    def _show_call_menu(self, key: str, position: QPoint) -> None:
        record = next((each for each in self.acting.calls.records if str(each.number) == key), None)
        if record is None:
            return
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(
            self.theme.icon("repeat"), _("Use this request"), lambda: self._set_text(record.request)
        )
        menu.addAction(
            self.theme.icon("copy"), _("Copy the request"), lambda: self._copy_request(record.request)
        )
        menu.popup(position)

    def _copy_request(self, text: str) -> None:
        QGuiApplication.clipboard().setText(text)
        self.context.show_toast(_("Copied the request"))

    # -- overrides ----------------------------------------------------------------------------------------

    def more_actions(self) -> Sequence[QAction]:
        self._clear_action.setEnabled(bool(self.acting.calls.records))
        return (self._duration_menu.entry(), self._clear_action)

    def focus_filter(self) -> bool:
        self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.filter.selectAll()
        return True

    def theme_changed(self) -> None:
        self.list.fit_rows()
        self._list_detail_view.fit()

    def save_state(self) -> dict[str, object]:
        return {"service": self.service}

    def restore_state(self, state: Mapping[str, object]) -> None:
        self._requested_service = str(state.get("service", ""))
        self._rebuild()

    def dispose(self) -> None:
        self.acting.disarm()


def _request_cell(record: CallRecord) -> Cell:
    # Formats a request in one line, such as "name Aiko, pictures 12".
    try:
        request = parse_json_text(record.request).fill({})
    except NepError:
        request = None
    if isinstance(request, Mapping):
        text = ", ".join(f"{name} {_one_line(value)}" for name, value in request.items()) or _("nothing")
    else:
        text = " ".join(record.request.split())
    return Cell(shortened(text, MAX_REQUEST_CHARS))


def _one_line(value: object) -> str:
    return value if isinstance(value, str) else " ".join(format_json(value).split())


PANEL = Panel(
    "services",
    lazy("Services"),
    "spline",
    (),
    ServicesPanel,
    home=(TabHome("developer", "inspector"), TabHome("behaviour", "behaviour")),
    commands=(
        Command(
            "service.show",
            lazy("Call a service"),
            lambda _panel: None,
            icon="spline",
            tip=lazy("Shows the services that programs offer"),
            after="publish.new",
        ),
    ),
    intents=(IntentHandler(SelectService, lambda panel, intent: panel.open_for(intent.service)),),
)
