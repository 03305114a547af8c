"""Sheet "Record": topics and settings, progress of the recording, and the flight recorder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from PySide6.QtCore import QPoint, QRect, QSize, Qt, QTimer
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLineEdit, QScrollArea, QVBoxLayout, QWidget

from app.core.network.topics import Topic
from app.core.recording.client import LOW_DISK_BYTES
from app.core.recording.topic_choice import (
    MAX_GB,
    MAX_MINUTES,
    MAX_S,
    MIN_GB,
    MIN_MINUTES,
    MIN_S,
    RecordingChoice,
)
from app.ui.shell.dialogs.overlay import EDGE_MARGIN, Overlay
from app.ui.text.numbers import age_text, bandwidth_text, group_digits, length_text, rate_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Card,
    FixedWidthLabel,
    NumberEdit,
    Segments,
    Separator,
    Switch,
    ValueBar,
    assign_command,
    label,
    set_role,
)
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.pattern_field import PatternField
from app.ui.widgets.menus import FieldContextMenu
from app.ui.widgets.table.model import Cell, Column, TableModel
from app.ui.widgets.table.view import TableView
from nep.errors import BadTopicError
from nep.i18n import _, lazy, ngettext, pgettext

if TYPE_CHECKING:
    from app.core.session import Session
    from app.ui.panels.base import ShowToast
    from nep.recordings.recorder import TopicSelection

WIDTH, HEIGHT, SIDE_MARGIN = 640, 812, 20
MIN_DOCKED_WIDTH = 1280  # px at 100 % text; in wider windows the sheet covers one column, without a scrim
TOP_OFFSET = 88
REFRESH_MS = 300
MIN_TABLE_HEIGHT = 170
LABEL_WIDTH, NUMBER_WIDTH, BAR_WIDTH = 80, 84, 120
MAX_DISPLAYED_S = 2 * 86_400.0
"""Threshold in s; if the disk has space for a longer recording, the remaining time is not shown."""
_BYTES_PER_GB = 1e9


class RecordMeter(QWidget):
    """Labelled value with a note below it; blank if the value is unknown."""

    def __init__(self, name: str) -> None:
        super().__init__()
        self._name = name
        self.value, self.note = FixedWidthLabel("title", "text"), FixedWidthLabel("small", "textSecondary")
        column = QVBoxLayout(self)
        column.setContentsMargins(12, 8, 8, 8)
        column.setSpacing(1)
        column.addWidget(label(name, "small", role="textSecondary"))
        column.addWidget(self.value)
        column.addWidget(self.note)

    def set_value(self, value: str, note: str = "", role: str = "textSecondary") -> None:
        """Set the value and the note.

        Args:
            value: Formatted value, or "" if it is unknown.
            note: Text below the value.
            role: Colour role of the note.
        """
        self.value.setText(value)
        self.note.setText(note)
        set_role(self.note, role)
        self.setAccessibleName(f"{self._name}: {value}" if value else self._name)


class RecordSheet(Overlay):
    """Sheet with the settings of recordings and of the flight recorder.

    Settings of recordings are saved for the next one; settings of the flight recorder are applied
    immediately.
    """

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        session: Session,
        save_last: Callable[[], None],
        show_toast: ShowToast,
    ) -> None:
        # `save_last` saves the contents of the flight recorder.
        super().__init__(theme, window, _("Record"))
        self._session, self._recordings, self._show_toast = session, session.recordings, show_toast
        self._last_topics_state: object = None
        self._included_topics: set[str] = set()
        self._last_sample: tuple[float, int] | None = None
        self._write_bandwidth_Bps: float | None = None
        self._create_meters()
        self._create_form()
        self._create_flight_recorder(save_last)
        self._create_footer()
        self._arrange()
        self._timer = QTimer(self)
        self._timer.setInterval(REFRESH_MS)
        self._timer.timeout.connect(self.show_state)
        self.closed.connect(self._timer.stop)

    def _create_meters(self) -> None:
        self.length = RecordMeter(_("Length"))
        self.current_size = RecordMeter(_("Current size"))
        self.write_errors = RecordMeter(_("Write errors"))
        self.disk = RecordMeter(_("Free space"))
        self.expected_size = RecordMeter(_("Expected"))
        self._meters = Card()
        row = QHBoxLayout(self._meters)
        row.setContentsMargins(1, 1, 1, 1)
        row.setSpacing(0)
        meters = (self.length, self.current_size, self.write_errors, self.disk, self.expected_size)
        for index, meter in enumerate(meters):
            if index:
                self._end_line = Separator(self.theme, upright=True)
                row.addWidget(self._end_line)
            row.addWidget(meter, 1)
        self._show_end(None)

    def _create_form(self) -> None:
        theme = self.theme
        self.name = self._field(_("Name"), _("default: date and time"))
        self.note = self._field(_("Note"), _("subject"))
        options = [
            ("all", pgettext("topics", "All"), None),
            ("chosen", _("Selected"), None),
            ("pattern", _("By pattern"), None),
        ]
        self.mode = Segments(theme, options, check=True, name=_("Topics"))
        self.mode.changed.connect(self._set_mode)
        self.count = label("", "small", role="textSecondary")
        self.patterns = PatternField(theme, _("Patterns"), _("/arm/* *camera* not /arm/raw"))
        self.patterns.changed.connect(self._apply_patterns)
        self.pattern_error = label("", "small", role="error", wrap=True)
        self.model: TableModel[Topic] = TableModel(self._columns(), lambda topic: topic.name)
        self.table: TableView[Topic] = TableView(theme, self.model, "topic")
        self.table.setAccessibleName(_("Topics to record"))
        self.table.opened.connect(self._toggle_topic)
        self.table.order_changed.connect(self._show_topics)
        self.table.setMinimumHeight(MIN_TABLE_HEIGHT)
        self.new_topics_hint = label(
            _("New matching topics are recorded from their first message."), "small", role="textTertiary",
            wrap=True,
        )  # fmt: skip

        self.limit_minutes = NumberEdit(
            theme, MIN_MINUTES, MAX_MINUTES, pgettext("minutes", "min"), 1, may_be_empty=True
        )
        self.limit_minutes.setAccessibleName(_("Stop after (minutes)"))
        self.limit_gb = NumberEdit(theme, MIN_GB, MAX_GB, "GB", 1, may_be_empty=True)
        self.limit_gb.setAccessibleName(_("Stop at (GB)"))
        for field, name in ((self.limit_minutes, "max_minutes"), (self.limit_gb, "max_gb")):
            field.setFixedWidth(round(theme.scaled(NUMBER_WIDTH)))
            field.number_entered.connect(lambda value, name=name: self._update_limits(**{name: value}))
            field.cleared.connect(lambda name=name: self._update_limits(**{name: None}))
            field.problem_changed.connect(self._show_limits_problem)
        self.limits_hint = label("", "small", role="textSecondary", wrap=True)

    def _field(self, name: str, example: str) -> QLineEdit:
        field = QLineEdit()
        field.setAccessibleName(name)
        field.setPlaceholderText(example)
        field.setProperty("focusRadius", self.theme.radius("control"))
        field.setMaxLength(400)
        FieldContextMenu(self.theme, field)
        return field

    def _create_flight_recorder(self, save_last: Callable[[], None]) -> None:
        theme = self.theme
        self.ring = Switch(theme, _("Flight recorder"))
        self.ring.clicked.connect(self._toggle_flight_recorder)
        self.seconds = NumberEdit(theme, MIN_S, MAX_S, _("s"))
        self.seconds.setAccessibleName(_("Seconds to keep"))
        self.seconds.number_entered.connect(lambda value: self._update_flight_recorder(seconds=round(value)))
        self.size_gb = NumberEdit(theme, MIN_GB, MAX_GB, "GB", 1)
        self.size_gb.setAccessibleName(_("Maximum size on disk (GB)"))
        self.size_gb.number_entered.connect(lambda value: self._update_flight_recorder(size_gb=value))
        for field in (self.seconds, self.size_gb):
            field.setFixedWidth(round(theme.scaled(NUMBER_WIDTH)))
            field.problem_changed.connect(self._show_flight_recorder_problem)
        self.ring_topics = PatternField(theme, _("Topics to keep"), _("all topics; or /arm/* *camera*"))
        self.ring_topics.editing_finished.connect(self._apply_flight_recorder_topics)
        self.ring_bar = ValueBar(theme)
        self.ring_text = label("", "small", role="textSecondary", wrap=True)
        self.keep = Button(theme, "", "history", size="small")
        assign_command(self.keep, "recording.keep")
        self.keep.clicked.connect(save_last)

    def _create_footer(self) -> None:
        theme = self.theme
        self.foot = label(
            _("At most 1 s of data is lost in a power failure"), "small", role="textTertiary", wrap=True
        )
        self.bookmark = Button(theme, _("Bookmark"), "bookmark", size="form")
        self.bookmark.clicked.connect(self._add_bookmark)
        self.record = Button(theme, _("Record"), "circle-dot", kind="primary", size="form")
        assign_command(self.record, "recording.toggle")
        self.record.clicked.connect(self._toggle_recording)

    def _form_rows(self) -> QGridLayout:
        form = QGridLayout()
        form.setHorizontalSpacing(8)
        form.setVerticalSpacing(8)
        form.setColumnMinimumWidth(0, round(self.theme.scaled(LABEL_WIDTH)))
        form.setColumnStretch(1, 1)
        modes = _flow(self.mode, self.count)
        for row, (text, field) in enumerate(((_("Name"), self.name), (_("Note"), self.note))):
            form.addWidget(label(text, "body", role="textSecondary"), row, 0)
            form.addWidget(field, row, 1)
        form.addWidget(label(_("Topics"), "body", role="textSecondary"), 2, 0)
        form.addLayout(modes, 2, 1)
        form.addWidget(self.patterns, 3, 1)
        form.addWidget(self.pattern_error, 4, 1)
        return form

    def _limits_row(self) -> Flow:
        title = label(_("Stop"), "body", role="textSecondary")
        title.setMinimumWidth(round(self.theme.scaled(LABEL_WIDTH)))
        labels = [label(_("after")), label(_("or at"))]
        return _flow(title, labels[0], self.limit_minutes, labels[1], self.limit_gb, self.limits_hint)

    def _flight_recorder_card(self) -> Card:
        box = Card(is_sunken=True)
        rows = QVBoxLayout(box)
        rows.setContentsMargins(12, 10, 12, 10)
        rows.setSpacing(8)
        labels = [label(each) for each in (_("keeps the last"), _("using up to"), _("on disk"))]
        self.ring_bar.setFixedWidth(round(self.theme.scaled(BAR_WIDTH)))
        settings_row = _flow(self.ring, labels[0], self.seconds, labels[1], self.size_gb, labels[2])
        state_row = _flow(self.ring_bar, self.ring_text, self.keep)
        rows.addLayout(settings_row)
        rows.addWidget(self.ring_topics)
        rows.addLayout(state_row)
        return box

    def _create_scroll_area(self) -> QScrollArea:
        self._content = QWidget()
        self._content.setProperty("bare", "true")
        column = QVBoxLayout(self._content)
        column.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 4)
        column.setSpacing(12)
        column.addWidget(self._meters)
        column.addLayout(self._form_rows())
        column.addWidget(self.table, 1)
        column.addWidget(self.new_topics_hint)
        column.addLayout(self._limits_row())
        column.addWidget(self._flight_recorder_card())
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        area.viewport().setAutoFillBackground(False)
        area.setWidget(self._content)
        return area

    def _arrange(self) -> None:
        self._area = self._create_scroll_area()
        header = self.create_header(label(_("Record"), "heading"))
        header.setContentsMargins(SIDE_MARGIN, 0, 12, 0)
        footer = QHBoxLayout()
        footer.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        footer.setSpacing(8)
        footer.addWidget(self.foot, 1)
        footer.addWidget(self.bookmark)
        footer.addWidget(self.record)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 12, 1, 12)
        column.setSpacing(10)
        column.addLayout(header)
        column.addWidget(self._area, 1)
        column.addWidget(Separator(self.theme))
        column.addLayout(footer)

    def initial_focus(self) -> QWidget:
        return self.record

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        min_width = self._content.minimumSizeHint().width() + 2
        return QSize(max(round(scaled(WIDTH)), min_width), round(scaled(HEIGHT))).boundedTo(room)

    def _is_docked(self) -> bool:
        return self.covered_window().width() >= self.theme.scaled(MIN_DOCKED_WIDTH)

    def _geometry_at(self, top: int) -> QRect:
        if not self._is_docked():
            return super()._geometry_at(top)
        window = self.covered_window()
        top = max(top, round(self.theme.scaled(TOP_OFFSET)))
        room = QSize(window.width() - 2 * EDGE_MARGIN, window.height() - top - 2 * EDGE_MARGIN)
        return QRect(QPoint(EDGE_MARGIN // 2, top), self.preferred_size(room))

    def place(self) -> None:
        super().place()
        if self.isVisible():
            self._scrim.setVisible(not self._is_docked())

    def _focus_changed(self, old: QWidget | None, new: QWidget | None) -> None:
        if not self._is_docked():  # otherwise the user works in the window while the sheet shows the progress
            super()._focus_changed(old, new)

    def open(self) -> None:
        """Open the sheet and update the progress until it is closed."""
        self._show_settings()
        self.show_state()
        self._timer.start()
        super().open()
        self.place()

    def _columns(self) -> tuple[Column[Topic], ...]:
        def size_cell(topic: Topic) -> Cell:
            recorded = self._recordings.client.state.topics.get(topic.name)
            if not self._is_included(topic.name):
                return Cell(_("excluded"), role="textTertiary")
            return Cell(size_text(recorded.size_bytes) if recorded is not None else "")

        def lost_cell(topic: Topic) -> Cell:
            recorded = self._recordings.client.state.topics.get(topic.name)
            if recorded is None or recorded.lost is None:
                return Cell()
            has_lost = recorded.lost > 0
            return Cell(
                group_digits(recorded.lost),
                "triangle-alert" if has_lost else None,
                "warn" if has_lost else "text",
            )

        def included_cell(topic: Topic) -> Cell:
            if self._is_included(topic.name):
                return Cell(icon="check", role="accentText", accessible_text=_("recorded"))
            return Cell(icon="minus", role="textTertiary", accessible_text=_("excluded"))

        def text_role(topic: Topic) -> str:
            return "text" if self._is_included(topic.name) else "textTertiary"

        return (
            Column("has", "", 40, included_cell, label=lazy("Recorded")),
            Column("topic", lazy("Topic"), 170, lambda topic: Cell(topic.name, role=text_role(topic),
                   mono=True),
                   key=lambda topic: topic.name, stretch=True, tip=lambda topic: topic.name),
            Column("rate", lazy("Rate /s"), 72,
                   lambda topic: Cell(rate_text(topic.rate_hz), role=text_role(topic)),
                   key=lambda topic: topic.rate_hz, is_numeric=True, hide_order=3),
            Column("bandwidth", lazy("Bandwidth"), 88,
                   lambda topic: Cell(bandwidth_text(topic.bandwidth_Bps), role=text_role(topic)),
                   key=lambda topic: topic.bandwidth_Bps, is_numeric=True, hide_order=2),
            Column("size", lazy("Size"), 84, size_cell, is_numeric=True, hide_order=1),
            Column("lost", lazy("Lost in transit"), 112, lost_cell, is_numeric=True),
        )  # fmt: skip

    @property
    def choice(self) -> RecordingChoice:
        """Topics and limits of the current recording or, if there is none, of the next one."""
        recordings = self._recordings
        return recordings.active_choice if recordings.is_recording else recordings.choice

    def _selection(self) -> TopicSelection | None:
        choice = self.choice
        if choice.mode == "chosen" and not choice.topics:
            return None
        try:
            return choice.selection
        except BadTopicError:
            return None

    def _is_included(self, topic: str) -> bool:
        return topic in self._included_topics

    def _show_settings(self) -> None:
        choice, settings = self.choice, self._recordings.ring_settings
        self.mode.set_value(choice.mode)
        self.patterns.show_patterns(choice.patterns, choice.excluded)
        self.patterns.setVisible(choice.mode == "pattern")
        problem = choice.problem if choice.mode == "pattern" else ""
        self._show_pattern_problem(problem)
        for field, limit in ((self.limit_minutes, choice.max_minutes), (self.limit_gb, choice.max_gb)):
            if limit is not None:
                field.show_number(limit)
            else:
                field.clear()
        self._show_limits_problem("")
        self.ring.setChecked(settings.is_on)
        self.ring_topics.show_patterns(settings.patterns, settings.excluded)
        self.ring_topics.set_invalid(is_invalid=bool(settings.problem))
        self.seconds.show_number(settings.seconds)
        self.size_gb.show_number(settings.size_gb)
        self._last_topics_state = None

    def _show_pattern_problem(self, problem: str) -> None:
        self.pattern_error.setText(problem)
        self.pattern_error.setVisible(bool(problem))
        self.patterns.set_invalid(is_invalid=bool(problem))

    def show_state(self) -> None:
        """Update the sheet to the state of the recording and of the flight recorder."""
        recordings = self._recordings
        is_recording = recordings.is_recording
        self.record.set_label(_("Stop recording") if is_recording else _("Record"))
        self.record.setEnabled(recordings.client.state.phase != "ending")
        self.bookmark.setEnabled(recordings.client.state.phase == "recording")
        for field in (self.name, self.note, self.mode, self.patterns, self.limit_minutes, self.limit_gb):
            field.setEnabled(not is_recording)
        self._show_meters()
        self._show_topics()
        self._show_flight_recorder()
        is_master_missing = self._session.live.master.kind != "connected"
        self.foot.setText(
            _("Waiting for a master; recording starts when one appears")
            if is_master_missing
            else _("At most 1 s of data is lost in a power failure")
        )

    def _show_meters(self) -> None:
        recordings, state = self._recordings, self._recordings.client.state
        if not recordings.is_recording:
            self._last_sample = self._write_bandwidth_Bps = None
            for meter in (self.length, self.current_size, self.write_errors, self.disk):
                meter.set_value("")
            self._show_end(None)
            return
        elapsed = recordings.elapsed_s
        if self._last_sample is None or state.size_bytes < self._last_sample[1]:
            self._last_sample = (elapsed, state.size_bytes)
        elif elapsed - self._last_sample[0] >= 1.0 and state.size_bytes != self._last_sample[1]:
            self._write_bandwidth_Bps = (state.size_bytes - self._last_sample[1]) / (
                elapsed - self._last_sample[0]
            )
            self._last_sample = (elapsed, state.size_bytes)
        bandwidth = self._write_bandwidth_Bps
        is_starting = state.phase == "starting"
        self.length.set_value(length_text(elapsed), _("starting") if is_starting else _("recording"), "error")
        written = (
            _("{speed} written").format(speed=bandwidth_text(bandwidth)) if bandwidth is not None else ""
        )
        self.current_size.set_value(size_text(state.size_bytes), written)
        count = ngettext("{count} message", "{count} messages", state.unwritten_count)
        self.write_errors.set_value(
            count.format(count=group_digits(state.unwritten_count)) if state.unwritten_count else _("none"),
            _("the disk is too slow") if state.unwritten_count else _("all data written"),
            "warn" if state.unwritten_count else "ok",
        )
        self._show_end(recordings.active_choice.expected_end(elapsed, state.size_bytes, bandwidth))
        free = state.free_bytes
        if free is None:
            self.disk.set_value("")
            return
        remaining_s = free / bandwidth if bandwidth else MAX_DISPLAYED_S
        full_text = (
            _("full in {time}").format(time=age_text(remaining_s)) if remaining_s < MAX_DISPLAYED_S else ""
        )
        self.disk.set_value(size_text(free), full_text, "warn" if free < LOW_DISK_BYTES else "textSecondary")

    def _show_end(self, end: tuple[float, float] | None) -> None:
        # Only for a recording with limits and a known data rate.
        for widget in (self._end_line, self.expected_size):
            widget.setVisible(end is not None)
        if end is not None:
            at_s, size_bytes = end
            self.expected_size.set_value(size_text(size_bytes), _("at {time}").format(time=length_text(at_s)))

    def _show_limits_problem(self, message: str) -> None:
        # Explains the limits, or what is wrong with them.
        has_both = bool(self.limit_minutes.text() and self.limit_gb.text())
        has_none = not (self.limit_minutes.text() or self.limit_gb.text())
        default_hint = _("whichever comes first") if has_both else _("no limit") if has_none else ""
        self.limits_hint.setText(message or default_hint)
        set_role(self.limits_hint, "error" if message else "textSecondary")

    def _show_topics(self) -> None:
        topics = sorted(self._session.shown.topics.existing_topics(), key=lambda topic: topic.name)
        state = (self._session.shown.topics.revision, self.choice)
        if state != self._last_topics_state:
            self._last_topics_state = state
            selection = self._selection()
            self._included_topics = {
                each.name for each in topics if selection is not None and selection.has(each.name)
            }
            self.model.set_rows(self.table.order.sort(topics))
            self.table.viewport().update()
        else:
            self.table.refresh_visible()
        included = [each for each in topics if each.name in self._included_topics]
        bandwidth = sum(each.bandwidth_Bps or 0.0 for each in included)
        count = ngettext("{count} of {all}", "{count} of {all}", len(topics))
        text = count.format(count=group_digits(len(included)), all=group_digits(len(topics)))
        if bandwidth:
            text = _("{topics}, {bandwidth}").format(topics=text, bandwidth=bandwidth_text(bandwidth))
        self.count.setText(text)
        self.new_topics_hint.setVisible(self.choice.mode != "chosen")

    def _show_flight_recorder(self) -> None:
        recordings, state = self._recordings, self._recordings.client.state
        settings = recordings.ring_settings
        self.keep.set_label(_("Save last {count} s").format(count=settings.seconds))
        self.keep.setEnabled(state.ring_s is not None)
        if state.ring_s is None:
            self.ring_bar.set_fraction(None)
            self.ring_text.setText(_("Starting…") if settings.is_on else _("Off: nothing is saved."))
            return
        self.ring_bar.set_fraction(state.ring_s / settings.seconds)
        text = _("{count} s buffered, {size} of {most}").format(
            count=round(min(state.ring_s, settings.seconds)),
            size=size_text(state.ring_bytes),
            most=size_text(settings.size_gb * _BYTES_PER_GB),
        )
        self.ring_text.setText(text)

    def _set_mode(self, mode: str) -> None:
        recordings = self._recordings
        choice = replace(recordings.choice, mode=mode)
        if mode == "chosen" and not choice.topics:
            choice = replace(choice, topics=tuple(sorted(self._included_topics)))
        recordings.set_choice(choice)
        self._show_settings()
        self.show_state()

    def _toggle_topic(self, topic: str) -> None:
        # Adds or removes the topic whose row was clicked.
        recordings = self._recordings
        if recordings.is_recording or recordings.choice.mode != "chosen":
            return
        topics = recordings.choice.topics
        other_topics = tuple(each for each in topics if each != topic)
        recordings.set_choice(
            replace(recordings.choice, topics=other_topics if topic in topics else (*topics, topic))
        )
        self.show_state()

    def _update_limits(self, **changes: float | None) -> None:
        # Limits apply to the next recording.
        recordings = self._recordings
        choice = replace(recordings.choice, **changes)  # type: ignore[arg-type]
        if choice != recordings.choice and not recordings.is_recording:
            recordings.set_choice(choice)
        self._show_limits_problem("")

    def _apply_patterns(self) -> None:
        included, excluded = self.patterns.patterns()
        choice = replace(self._recordings.choice, patterns=included, excluded=excluded)
        self._show_pattern_problem(choice.problem)
        self._recordings.set_choice(choice)
        self.show_state()

    def _toggle_flight_recorder(self) -> None:
        self._update_flight_recorder(is_on=self.ring.isChecked())

    def _update_flight_recorder(self, **changes: object) -> None:
        recordings = self._recordings
        settings = replace(recordings.ring_settings, **changes)  # type: ignore[arg-type]
        if settings != recordings.ring_settings:
            recordings.set_ring_settings(settings)
        self._show_flight_recorder()

    def _apply_flight_recorder_topics(self) -> None:
        included, excluded = self.ring_topics.patterns()
        problem = replace(self._recordings.ring_settings, patterns=included, excluded=excluded).problem
        self.ring_topics.set_invalid(is_invalid=bool(problem))
        if problem:
            self._show_flight_recorder_problem(problem)
        else:
            self._update_flight_recorder(patterns=included, excluded=excluded)

    def _show_flight_recorder_problem(self, message: str) -> None:
        self.ring_text.setText(message or self.ring_text.text())

    def _add_bookmark(self) -> None:
        self._recordings.client.add_bookmark("")
        self._show_toast(_("Bookmark at {time}").format(time=length_text(self._recordings.elapsed_s)))

    def _toggle_recording(self) -> None:
        recordings = self._recordings
        if recordings.is_recording:
            recordings.stop()
        else:
            reason = recordings.record(self.name.text(), self.note.text())
            if reason:
                self._show_toast(reason)
        self.show_state()


def _flow(*widgets: QWidget) -> Flow:
    flow = Flow(gap=8, row_gap=6)
    for widget in widgets:
        flow.addWidget(widget)
    return flow
