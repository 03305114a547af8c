"""Alarms panel: rules, their states, and the history of triggered alarms."""

from __future__ import annotations

import datetime as dt
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, Qt
from PySide6.QtGui import QAction, QActionGroup, QGuiApplication
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.parts.alarms import severity_of
from app.core.recording.recordings import saved_file_name
from app.core.storage.atomic_file import write_atomically
from app.intents import ShowAlarms
from app.ui.intents import NewAlarm, NewValueAlarm, OpenRecording
from app.ui.panels.base import Density, Panel, PanelContext, PanelWidget
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import TabHome
from app.ui.panels.watch.alarms.columns import (
    csv_text,
    history_columns,
    local_datetime,
    note_text,
    state_chip,
)
from app.ui.panels.watch.alarms.phrases import (
    ACTION_ICONS,
    ACTION_MENU,
    KIND_MENU,
    MENU_ROLES,
    NEW_ACTIONS,
    PhrasePart,
    initial_text,
    placeholder_of,
    rejection_text,
    with_action,
    with_kind,
    with_slot_text,
)
from app.ui.panels.watch.alarms.row import AlarmRow
from app.ui.panels.watch.alarms.slots import SlotField
from app.ui.text import plain
from app.ui.widgets import Button, Chip, ElidedLabel, EmptyAction, EmptyState, Separator, label
from app.ui.widgets.buttons import LinkButton
from app.ui.widgets.file_dialogs import FileKind
from app.ui.widgets.inputs.fields import FilterField
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from app.ui.widgets.menus import Menu, open_below
from app.ui.widgets.table.model import TableModel
from app.ui.widgets.table.view import TableView
from nep.errors import DecodeError, NepError
from nep.i18n import _, lazy, ngettext
from nep.messages.fields import leaf_paths, parse_path, value_at
from nep.programs.alarms import AlarmCondition, AlarmRule
from nep.programs.alarms.history import AlarmRecord
from nep.programs.alarms.rule import NUMBER_KINDS, new_id
from nep.programs.alarms.sentences import condition_text, duration_text

if TYPE_CHECKING:
    from app.core.network.watches import Watch

STATE_UPDATE_TICKS = 6  # refreshes at 30 Hz: states are updated five times a second
SNOOZE_S = 600.0
CALM_CHOICES_S = (0.5, 2.0, 10.0, 60.0)
TOPIC_ICONS = {"image": "image", "json": "braces", "string": "type", "bytes": "binary", "msgpack": "braces"}
CSV_KIND = FileKind(lazy("Comma-separated values"), ".csv")
MAX_COMPLETIONS = 500


class AlarmsPanel(PanelWidget):
    """Panel with the list of alarms and, below it, the history."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Alarms"))
        self.alarms = context.session.alarms
        self.now_s: Callable[[], float] = time.time
        self._last_revisions: tuple[object, ...] = ()
        self._last_history_revision: object = None
        self._ticks = 0
        self.rows: list[AlarmRow] = []
        self.field: SlotField | None = None
        self._value_watch: Watch | None = None
        self._new_rule_id = ""
        self._make_header()
        self._make_rows()
        self._make_history()
        self._arrange()
        self.refresh()

    # -- construction -------------------------------------------------------------------------------------

    def _make_header(self) -> None:
        self.count_label = label("", "small", role="textSecondary")
        self.chip = Chip(self.theme)
        self.chips = [self.count_label, self.chip]
        self.new_button = Button(self.theme, _("New alarm"), "plus", size="small")
        self.new_button.clicked.connect(self.add_alarm)
        self.header = [self.new_button]

    def _make_rows(self) -> None:
        self.alarm_list = ScrollColumn(_("Alarms"))
        self.column = self.alarm_list.column
        self.empty = EmptyState(
            self.theme,
            "bell",
            _("No alarms yet"),
            _("Right-click a value, topic or node."),
            [EmptyAction(_("New alarm"), self.add_alarm, "plus", is_primary=True)],
        )

    def _make_history(self) -> None:
        self.history_title = label(_("History"), "title")
        self.history_count = label("", "small", role="textSecondary")
        self.filter = FilterField(self.theme, _("Filter the history"))
        self.filter.textChanged.connect(self._show_history)
        self.export_button = Button(self.theme, _("CSV"), "download", size="small")
        self.export_button.setAccessibleName(_("Save the history as CSV"))
        self.export_button.clicked.connect(self._save_history)
        columns = history_columns(self._severity, lambda: local_datetime(self.now_s()))
        self.model: TableModel[AlarmRecord] = TableModel(
            columns, lambda record: f"{record.rule_id} {record.at_s}"
        )
        self.table = TableView(self.theme, self.model)
        self.table.setAccessibleName(_("Alarm history"))
        self.table.order_changed.connect(self._show_history)
        self.table.filter_requested.connect(self.focus_filter)
        self.table.opened.connect(self._scroll_to_alarm)
        self.table.menu_requested.connect(self._show_record_menu)
        self.filter.exited.connect(lambda: self.table.setFocus(Qt.FocusReason.ShortcutFocusReason))
        self._clear_action = QAction(_("Clear the history"), self)
        self._clear_action.triggered.connect(self.alarms.history.clear)

    def _arrange(self) -> None:
        header = QHBoxLayout()
        header.setContentsMargins(12, 6, 8, 4)
        header.setSpacing(8)
        header.addWidget(self.history_title)
        header.addWidget(self.history_count)
        header.addStretch(1)
        header.addWidget(self.filter)
        header.addWidget(self.export_button)
        footer = QHBoxLayout()
        footer.setContentsMargins(12, 3, 12, 4)
        footer.setSpacing(6)
        hint = ElidedLabel("small", "textTertiary")
        hint.setText(_("Right-click a value, topic or node to create an alarm"))
        self.command_button = LinkButton(self.theme, _("nep watch"))
        self.command_button.setToolTip(
            plain.tip(_("Copies the command that monitors these alarms without Studio"))
        )
        self.command_button.setAccessibleName(_("Copy the command for a terminal: nep watch"))
        self.command_button.clicked.connect(self._copy_command)
        footer.addWidget(hint, 1)
        footer.addWidget(label(_("Monitor without Studio:"), "small", role="textTertiary"))
        footer.addWidget(self.command_button)
        content = QWidget()
        column = QVBoxLayout(content)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self.alarm_list, 5)
        column.addWidget(Separator(self.theme))
        column.addLayout(header)
        column.addWidget(self.table, 3)
        column.addWidget(Separator(self.theme))
        column.addLayout(footer)
        self.pages: QStackedWidget = self.make_page_stack(self.empty, content)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        revisions = (self.alarms.alarms.revision, self.session.live.topics.revision)
        if revisions != self._last_revisions:
            self._last_revisions = revisions
            self._show_rules()
            self._show_states()
        elif self._ticks % STATE_UPDATE_TICKS == 0:
            self._show_states()
        if self._last_history_revision != self.alarms.history.revision:
            self._show_history()
        elif self._ticks % 30 == 0:
            self.table.refresh_visible()
        if self.field is not None and self._ticks % STATE_UPDATE_TICKS == 0:
            self.field.set_completions(
                self._completions_for(self.field.slot.part, self._row_of(self.field.slot))
            )

    def _show_rules(self) -> None:
        rows_by_id = {row.rule_id: row for row in self.rows}
        rules = self.alarms.rules
        self.rows = [
            rows_by_id.pop(rule.id) if rule.id in rows_by_id else self._new_row(rule.id) for rule in rules
        ]
        for row in rows_by_id.values():
            self.column.removeWidget(row)
            row.hide()
            row.deleteLater()
        for index, (row, rule) in enumerate(zip(self.rows, rules, strict=True)):
            if self.column.indexOf(row) != index:
                self.column.insertWidget(index, row)
            row.show_rule(rule, self._topic_icon(rule), is_snoozed=rule.is_snoozed(self.now_s()))
        has_history = len(self.alarms.history) > 0
        self.pages.setCurrentIndex(1 if rules or has_history else 0)

    def _new_row(self, rule_id: str) -> AlarmRow:
        row = AlarmRow(self.theme, rule_id)
        row.switched.connect(partial(self._set_rule_enabled, rule_id))
        row.slot_pressed.connect(partial(self._open_slot, row))
        row.action_removed.connect(partial(self._remove_action, rule_id))
        row.snooze_pressed.connect(partial(self._snooze, rule_id))
        row.more_pressed.connect(partial(self._show_more_menu, row))
        return row

    def _topic_icon(self, rule: AlarmRule) -> str:
        topic = self.session.live.topics.get(rule.condition.name)
        return TOPIC_ICONS.get(topic.codec, "box") if topic is not None else "radio-tower"

    def _show_states(self) -> None:
        now_s, active_count = self.now_s(), 0
        now = local_datetime(now_s)
        for row, rule in zip(self.rows, self.alarms.rules, strict=True):
            state = self.alarms.alarms.evaluator.state(rule)
            active_count += state.phase == "on" and not rule.is_snoozed(now_s)
            row.show_state(*state_chip(rule, state, now_s), note_text(rule, state, self.alarms, now))
            row.snooze_button.setVisible(rule.is_enabled)
        count = len(self.rows)
        count_text = ngettext("{count} alarm", "{count} alarms", count).format(count=count)
        self.count_label.setText(count_text if count else "")
        active_text = ngettext("{count} active", "{count} active", active_count)
        self.chip.set(active_text.format(count=active_count) if active_count else "", "error")

    def _show_history(self) -> None:
        history = self.alarms.history
        self._last_history_revision = history.revision
        keywords = self.filter.text().casefold().split()
        rows = [each for each in history if all(keyword in each.cause.casefold() for keyword in keywords)]
        self.model.set_rows(self.table.order.sort(rows))
        self.table.refresh_visible()
        midnight = local_datetime(self.now_s()).replace(hour=0, minute=0, second=0, microsecond=0)
        yesterday = (midnight - dt.timedelta(days=1)).timestamp()
        today_count = sum(each.at_s >= midnight.timestamp() for each in history)
        yesterday_count = sum(yesterday <= each.at_s < midnight.timestamp() for each in history)
        template = _("today {today}, yesterday {yesterday}") if yesterday_count else _("today {today}")
        summary = template.format(today=today_count, yesterday=yesterday_count)
        self.history_count.setText(summary if len(history) else _("no events yet"))
        for widget in (self.filter, self.export_button):
            widget.setVisible(len(history) > 0)
        if len(history) and not self.rows:
            self.pages.setCurrentIndex(1)

    def _severity(self, record: AlarmRecord) -> str:
        rule = self.alarms.alarms.rule(record.rule_id)
        return severity_of(rule.condition) if rule is not None else "error"

    def badge(self) -> tuple[str, str] | None:
        active_count = len(self.alarms.active)
        return (str(active_count), "error") if active_count else None

    # -- user actions -------------------------------------------------------------------------------------

    def add_alarm(self) -> None:
        """Create an alarm and start editing its topic."""
        self.edit(self.alarms.create(AlarmCondition("silent", for_s=2.0)).id, "subject")

    def create_alarm(self, condition: AlarmCondition) -> None:
        """Create an alarm and open it for editing.

        An alarm on a number stays off until the user has confirmed the limit.
        """
        rule = self.alarms.create(condition)
        needs_limit = condition.kind in NUMBER_KINDS  # the limit has to be entered first
        if needs_limit:
            self.alarms.set_rule(replace(rule, is_enabled=False))
        self.edit(rule.id, "limit" if needs_limit else "")

    def create_value_alarm(self, topic: str, path: str) -> None:
        """Create an alarm on a field of a topic: on a limit for a number, else on any change.

        Args:
            topic: Key of the topic.
            path: Path of the field; "" is the path of the whole payload.
        """
        topic_state = self.session.shown.topics.get(topic)
        newest = topic_state.newest if topic_state is not None else None
        value: object = None
        with suppress(NepError):
            value = value_at(newest.payload, parse_path(path or ".")) if newest is not None else None
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        limit = value if isinstance(value, int | float) and is_number else None
        self.create_alarm(AlarmCondition("below" if is_number else "changes", topic, path or ".", limit))

    def edit(self, rule_id: str, slot: str) -> None:
        """Scroll to an alarm and start editing one of its slots.

        Args:
            rule_id: Id of the alarm's rule.
            slot: Key of the slot, such as "limit"; "" only gives the alarm the focus.
        """
        self._show_rules()
        self._last_revisions = ()
        self._new_rule_id = rule_id if slot == "limit" else ""
        row = next((row for row in self.rows if row.rule_id == rule_id), None)
        if row is None:
            return
        row.show()
        self.alarm_list.ensureWidgetVisible(row)
        slot_widget = row.slots.get(slot) or row.slots["kind"]
        slot_widget.setFocus(Qt.FocusReason.ShortcutFocusReason)
        if slot:
            self._open_slot(row, slot_widget.part)

    def _rule(self, rule_id: str) -> AlarmRule | None:
        return self.alarms.alarms.rule(rule_id)

    def _save_rule(self, rule: AlarmRule) -> None:
        self.alarms.set_rule(rule)
        self.refresh()

    def _set_rule_enabled(self, rule_id: str, is_enabled: bool) -> None:
        rule = self._rule(rule_id)
        if rule is not None:
            self._save_rule(replace(rule, is_enabled=is_enabled))

    def _open_slot(self, row: AlarmRow, part: PhrasePart) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        if part.role in MENU_ROLES or part.role == "action":
            menu = Menu(self.theme, self)
            menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
            (self._fill_kinds if part.role == "kind" else self._fill_actions)(menu, row, part)
            open_below(menu, row.slots[part.key])
        else:
            self._open_field(row, rule, part)

    def _open_field(self, row: AlarmRow, rule: AlarmRule, part: PhrasePart) -> None:
        if self.field is not None:
            self.field.dismiss(keeps_focus=False)
        condition = rule.condition
        if part.role in {"value", "limit"} and condition.name and self._value_watch is None:
            # field names and values to offer come from the newest message
            self._value_watch = self.session.live.watch(condition.name)
        self.field = SlotField(
            self.theme,
            row,
            row.slots[part.key],
            initial_text(rule, part),
            placeholder_of(part, rule),
            lambda text: self._apply(row, part, text),
            rejection=rejection_text(part, rule),
        )
        self.field.closed.connect(self._field_closed)
        self.field.set_completions(self._completions_for(part, row))

    def _apply(self, row: AlarmRow, part: PhrasePart, text: str) -> bool:
        rule = self._rule(row.rule_id)
        if rule is None:
            return True
        changed_rule = with_slot_text(rule, part, text)
        if changed_rule is None:
            return False
        if part.role == "limit" and self._new_rule_id == rule.id:
            # a new alarm stays disabled until its limit is entered
            changed_rule, self._new_rule_id = replace(changed_rule, is_enabled=True), ""
        if changed_rule != rule:
            self._save_rule(changed_rule)
        return True

    def _field_closed(self) -> None:
        self.field = None
        if self._value_watch is not None:
            self._value_watch.close()
            self._value_watch = None

    def _row_of(self, slot: QWidget) -> AlarmRow:
        return next(row for row in self.rows if slot in row.slots.values())

    def _completions_for(self, part: PhrasePart, row: AlarmRow) -> Sequence[str]:
        rule = self._rule(row.rule_id)
        if rule is None:
            return ()
        match part.role:
            case "subject" if rule.condition.is_about_node:
                return sorted({node.name for node in self.session.live.nodes})[:MAX_COMPLETIONS]
            case "subject":
                return sorted(topic.name for topic in self.session.live.topics.existing_topics())[
                    :MAX_COMPLETIONS
                ]
            case "value":
                return self._field_paths(rule.condition.name)
            case "time":
                return [duration_text(seconds) for seconds in (0.5, 1, 2, 5, 10, 30, 60, 600)]
            case "name":
                return self._target_names(rule.actions[part.action_index].kind)
            case _:
                return ()

    def _field_paths(self, name: str) -> list[str]:
        topic = self.session.live.topics.get(name)
        newest = topic.newest if topic is not None else None
        if newest is None or newest.size_bytes > 256 * 1024:
            return []
        try:
            return list(leaf_paths(newest.payload))
        except DecodeError:
            return []

    def _target_names(self, kind: str) -> list[str]:
        if kind == "call":
            return sorted(self.session.live.graph.services) if self.session.live.graph is not None else []
        if kind == "send":
            return sorted(topic.name for topic in self.session.live.topics.existing_topics())[
                :MAX_COMPLETIONS
            ]
        titles = [self.session.documents.title(project) for project in self.session.documents]
        return list(dict.fromkeys([*titles, *(file.name for file in self.session.settings.recent_files)]))

    # -- menus --------------------------------------------------------------------------------------------

    def _fill_kinds(self, menu: Menu, row: AlarmRow, _part: PhrasePart) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        for group in KIND_MENU:
            if menu.actions():
                menu.addSeparator()
            for kind, kind_label in group:
                action = menu.addAction(_(kind_label))
                action.setCheckable(True)
                action.setChecked(kind == rule.condition.kind)
                action.triggered.connect(partial(self._set_kind, row, kind))

    def _set_kind(self, row: AlarmRow, kind: str, _on: bool = False) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        changed_rule = with_kind(rule, kind)
        self._save_rule(changed_rule)
        condition = changed_rule.condition
        missing_slot = (
            "subject"
            if not condition.name
            else "value"
            if condition.is_about_value and not condition.path
            else ""
        )
        if missing_slot:
            row.slots[missing_slot].setFocus(Qt.FocusReason.OtherFocusReason)

    def _fill_actions(self, menu: Menu, row: AlarmRow, part: PhrasePart) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        is_new = part.role == "add"
        index = len(rule.actions) if is_new else part.action_index
        existing_kinds = {action.kind for action in rule.actions}
        for action in NEW_ACTIONS:
            if action.kind in existing_kinds and action.kind not in {"run", "call", "send"}:
                continue
            entry = menu.addAction(self.theme.icon(ACTION_ICONS[action.kind]), _(ACTION_MENU[action.kind]))
            entry.triggered.connect(partial(self._set_action, row, index, action))
        if not is_new:
            menu.addSeparator()
            entry = menu.addAction(self.theme.icon("trash-2"), _("Remove this action"))
            entry.triggered.connect(partial(self._remove_action, row.rule_id, part))

    def _set_action(self, row: AlarmRow, index: int, action: object, _on: bool = False) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        self._save_rule(with_action(rule, index, action))  # type: ignore[arg-type]
        name = row.slots.get(f"name:{index}")
        if name is not None:
            self._open_slot(row, name.part)

    def _remove_action(self, rule_id: str, part: PhrasePart, _on: bool = False) -> None:
        rule = self._rule(rule_id)
        if rule is not None and part.action_index < len(rule.actions):
            self._save_rule(with_action(rule, part.action_index, None))

    def _snooze(self, rule_id: str, seconds: float = SNOOZE_S, _on: bool = False) -> None:
        rule = self._rule(rule_id)
        if rule is not None:
            is_snoozed = rule.is_snoozed(self.now_s())
            self.alarms.snooze(rule_id, 0.0 if is_snoozed or not seconds else self.now_s() + seconds)
            self.refresh()

    def _until_tomorrow_s(self) -> float:
        now = local_datetime(self.now_s())
        tomorrow = (now + dt.timedelta(days=1)).replace(hour=0, minute=0, second=0, microsecond=0)
        return tomorrow.timestamp() - self.now_s()

    def _show_more_menu(self, row: AlarmRow) -> None:
        rule = self._rule(row.rule_id)
        if rule is None:
            return
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        if rule.is_snoozed(self.now_s()):
            menu.addAction(self.theme.icon("bell"), _("Stop snoozing"), partial(self._snooze, rule.id, 0.0))
        else:
            for text, seconds in (
                (_("Snooze for 10 min"), SNOOZE_S),
                (_("Snooze for 1 h"), 3600.0),
                (_("Snooze until tomorrow"), self._until_tomorrow_s()),
            ):
                menu.addAction(self.theme.icon("bell-off"), text, partial(self._snooze, rule.id, seconds))
        menu.addSeparator()
        group = QActionGroup(menu)
        for calm_s in CALM_CHOICES_S:
            label_text = _("Stay active until the condition has been false for {time}").format(
                time=duration_text(calm_s)
            )
            action = menu.addAction(label_text)
            action.setCheckable(True)
            action.setChecked(rule.calm_s == calm_s)
            action.triggered.connect(partial(self._set_calm, rule.id, calm_s))
            group.addAction(action)
        menu.addSeparator()
        menu.addAction(self.theme.icon("copy"), _("Duplicate"), partial(self._duplicate, rule.id))
        menu.addAction(self.theme.icon("trash-2"), _("Delete"), partial(self._delete, rule.id))
        open_below(menu, row.more_button)

    def _set_calm(self, rule_id: str, calm_s: float, _on: bool = False) -> None:
        rule = self._rule(rule_id)
        if rule is not None:
            self._save_rule(replace(rule, calm_s=calm_s))

    def _duplicate(self, rule_id: str) -> None:
        rule = self._rule(rule_id)
        if rule is not None:
            duplicate = replace(rule, id=new_id(), snoozed_until_s=0.0)
            self._save_rule(duplicate)
            self.edit(duplicate.id, "")

    def _delete(self, rule_id: str) -> None:
        rule = self.alarms.remove(rule_id)
        if rule is not None:
            message = _("Deleted the alarm “{condition}”").format(condition=condition_text(rule.condition))
            self.context.show_toast(message, _("Undo"), self.alarms.restore)
            self.refresh()
            self.new_button.setFocus(Qt.FocusReason.OtherFocusReason)

    # -- history ------------------------------------------------------------------------------------------

    def _scroll_to_alarm(self, key: str) -> None:
        rule_id = key.partition(" ")[0]
        row = next((row for row in self.rows if row.rule_id == rule_id), None)
        if row is not None:
            self.alarm_list.ensureWidgetVisible(row)

    def _show_record_menu(self, key: str, position: QPoint) -> None:
        record = next((each for each in self.alarms.history if self.model.key_of(each) == key), None)
        file_names = (
            [saved_file_name(result.text) for result in record.action_results if result.kind == "keep"]
            if record
            else []
        )
        menu = Menu(self.theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addAction(self.theme.icon("bell"), _("Show the alarm"), partial(self._scroll_to_alarm, key))
        for name in filter(None, file_names):
            path = self.session.recordings.folder / name
            run = partial(self.context.request, OpenRecording(path))
            menu.addAction(self.theme.icon("history"), _("Open the recording"), run)
        menu.popup(position)

    def _save_history(self) -> None:
        suggestion = Path.home() / _("alarms.csv")
        self.context.files.save_as(_("Save the history"), suggestion, [CSV_KIND], self._write_history)

    def _write_history(self, path: Path, _kind: FileKind) -> None:
        try:
            write_atomically(path, csv_text(self.alarms.history.records).encode("utf-8"))
        except OSError as error:
            template = _("Can't write {file}: {reason}.")
            self.session.alerts.raise_alert(
                "alarms:csv", "warn", template.format(file=path.name, reason=error.strerror or error)
            )
        else:
            self.session.alerts.resolve("alarms:csv")
            self.context.show_toast(_("Saved {file}").format(file=path.name))

    def _copy_command(self) -> None:
        path = self.alarms.path
        command = f'nep watch "{path}"' if path is not None else "nep watch"
        QGuiApplication.clipboard().setText(command)
        self.context.show_toast(_("Copied {line}").format(line=command))

    # -- overrides ----------------------------------------------------------------------------------------

    def more_actions(self) -> list[QAction]:
        self._clear_action.setEnabled(len(self.alarms.history) > 0)
        return [self._clear_action]

    def focus_filter(self) -> bool:
        if self.filter.isVisibleTo(self):
            self.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
            self.filter.selectAll()
        return self.filter.isVisibleTo(self)

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self.table.set_row_height(self.row_height(), large=density == "comfortable")

    def theme_changed(self) -> None:
        self.table.set_row_height(self.row_height(), large=self.density == "comfortable")

    def dispose(self) -> None:
        if self.field is not None:
            self.field.dismiss(keeps_focus=False)
        if self._value_watch is not None:
            self._value_watch.close()


def _new_alarm_disabled_reason(context: PanelContext) -> str:
    return "" if context.layout() else _("The start page has no panels")


PANEL = Panel(
    "alarms",
    lazy("Alarms"),
    "bell",
    (),
    AlarmsPanel,
    home=(TabHome("behaviour", "behaviour"), TabHome("developer", "topics")),
    commands=(
        Command(
            "alarm.new",
            lazy("New alarm"),
            AlarmsPanel.add_alarm,
            "View",
            icon="bell",
            separator_above=True,
            disabled_reason=_new_alarm_disabled_reason,
            after="network.web",
        ),
    ),
    intents=(
        IntentHandler(ShowAlarms, lambda _panel, _intent: None),
        IntentHandler(NewAlarm, lambda panel, intent: panel.create_alarm(intent.condition)),
        IntentHandler(
            NewValueAlarm, lambda panel, intent: panel.create_value_alarm(intent.topic, intent.path)
        ),
    ),
)
