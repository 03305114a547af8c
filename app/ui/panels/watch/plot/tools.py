"""Toolbar of the plot, and the field for adding curves, in which Tab completes and Enter adds.

While the field has the focus, topics are subscribed to, so that the field can suggest their fields with
current values. Images and topics with a high data rate are excluded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, QPoint, Qt, QTimer, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.core.messages.reader import LARGE_BYTES, read
from app.core.series.field_path import PlottableField, complete, fields_of
from app.core.series.formula import FUNCTIONS, WINDOW_FUNCTIONS, FieldSource
from app.ui.panels.watch.plot.plotted_curve import value_text
from app.ui.panels.watch.plot.time_view import SPANS
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import MenuButton, Segments, ToggleButton, label, paint, set_role
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.fields import SearchField
from app.ui.widgets.inputs.frame import set_invalid
from app.ui.widgets.lists.entry_list import EntryList, Heading, Line
from app.ui.widgets.lists.fuzzy import Entry, Finder, Match, match
from nep.i18n import _, lazy, ngettext
from nep.messages.codecs import content_of

if TYPE_CHECKING:
    from app.core.network.topics import Topic
    from app.core.network.watches import Watch
    from app.core.session import Session

MATCHES_WIDTH, MATCHES_HEIGHT = 470, 300
MAX_TOPICS, MAX_BYTES_PER_S = 40, 2e6
MAX_MATCHES, MAX_FIELDS = 60, 4000
REFRESH_MS = 250
ICONS = {"number": "hash", "state": "toggle-left", "list": "brackets"}
EXAMPLE_EXPRESSIONS = ("difference({})", "derivative({})", "integral({})", "mean({}, 2 s)")


class FieldCatalog:
    """Fields that can be plotted, read from the messages of topics.

    The topics are subscribed to only between `open` and `close`.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._watches: dict[str, Watch] = {}

    def open(self) -> None:
        """Subscribe to the topics whose fields can be plotted."""
        for topic in self._candidate_topics():
            if topic.key not in self._watches:
                self._watches[topic.key] = self._session.shown.watch(topic.key)

    def close(self) -> None:
        """Unsubscribe from all topics."""
        for watch in self._watches.values():
            watch.close()
        self._watches.clear()

    def _candidate_topics(self) -> list[Topic]:
        topics = [*self._session.shown.topics.existing_topics(), *self._session.shown.networks.topics]
        candidates = [
            topic
            for topic in topics
            if content_of(topic.codec) in {"values", "text"}
            and (topic.bandwidth_Bps or 0.0) <= MAX_BYTES_PER_S
        ]
        return candidates[:MAX_TOPICS]

    def topic_keys(self) -> list[str]:
        """Return the keys of all topics that exist."""
        return [
            topic.key
            for topic in (*self._session.shown.topics.existing_topics(), *self._session.shown.networks.topics)
        ]

    def fields(self) -> Iterable[tuple[str, PlottableField]]:
        """Yield each field that can be plotted, after the expression that plots it."""
        count = 0
        for key in self._watches:
            topic = self._session.shown.topic(key)
            newest = topic.newest if topic is not None else None
            if newest is None or newest.size_bytes > LARGE_BYTES:
                continue
            reading = read(newest)
            for field in fields_of(reading.value, 400) if reading.error is None else ():
                yield str(FieldSource(key, field.path)), field
                count += 1
                if count >= MAX_FIELDS:
                    return


class _MatchPopup(QWidget):
    """Popup list of matches below the field, as an overlay of the window."""

    def __init__(self, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.list = EntryList(theme, _("Matching fields"))
        self.footer = label("", "small", role="textTertiary")
        self.footer.setContentsMargins(14, 2, 10, 5)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 5, 1, 1)
        column.setSpacing(2)
        column.addWidget(self.list, 1)
        column.addWidget(self.footer)
        self.hide()


class AddCurveField(SearchField):
    """Field for adding a curve.

    Args:
        session: Session with the topics.
        plotted_expressions: Returns the expressions of existing curves, which can be used in formulas.

    Signals:
        add_requested: Expression of the curve to add, and True for the right axis.
        exited: The user pressed Esc.
    """

    icon_name = "plus"
    add_requested = Signal(str, bool)
    exited = Signal()

    def __init__(
        self, theme: Theme, session: Session, plotted_expressions: Callable[[], Iterable[str]]
    ) -> None:
        super().__init__(theme, _("Add a curve"), "C")
        self.setMinimumWidth(round(theme.scaled(150)))
        self._plotted_expressions = plotted_expressions
        self.catalog = FieldCatalog(session)
        self.error_message = ""
        self._matches: _MatchPopup | None = None
        self._offered_fields: dict[str, PlottableField] = {}
        self._timer = QTimer(self)
        self._timer.setInterval(REFRESH_MS)
        self._timer.timeout.connect(self._refresh_fields)
        self.textEdited.connect(self._search)

    # -- opening and closing ------------------------------------------------------------------------------

    @property
    def matches(self) -> _MatchPopup:
        """Popup list, created on first use."""
        window = self.window()
        if self._matches is None or self._matches.parentWidget() is not window:
            self._discard_popup()
            self._matches = _MatchPopup(self._theme, window)
            self._matches.list.row_activated.connect(lambda: self._commit(right=False))
        return self._matches

    def _discard_popup(self) -> None:
        if self._matches is not None:
            self._matches.deleteLater()
            self._matches = None

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.catalog.open()
        self._timer.start()
        self._search()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        if event.reason() != Qt.FocusReason.PopupFocusReason:
            self.dispose()

    def hideEvent(self, event: QEvent) -> None:
        super().hideEvent(event)  # type: ignore[arg-type]
        self.dispose()

    def dispose(self) -> None:
        """Unsubscribe from topics and hide the list."""
        self._timer.stop()
        self.catalog.close()
        self._offered_fields.clear()
        if self._matches is not None:
            self._matches.hide()

    def prompt(self, text: str) -> None:
        """Focus the field and set its text to the start of an expression, which the user completes."""
        self.setText(text)
        self.setFocus(Qt.FocusReason.ShortcutFocusReason)
        if text.endswith("."):
            self.end(False)  # setting the focus selected the text, so that typing would replace it
        self._search()

    def show_error(self, message: str) -> None:
        """Show why the text is not a valid curve. The text stays in the field.

        Args:
            message: Reason; "" removes the message.
        """
        self.error_message = message
        set_invalid(self, is_invalid=bool(message))
        self._update_footer(0)

    # -- matches ------------------------------------------------------------------------------------------

    def _refresh_fields(self) -> None:
        self.catalog.open()
        before = len(self._offered_fields)
        self._read_fields()
        if len(self._offered_fields) != before:
            self._search(keep_selection=True)
            return
        match_list = self.matches.list
        for line in list(match_list.line_model.lines):
            field = None if isinstance(line, Heading) else self._offered_fields.get(line.entry.text)
            if field is not None and not isinstance(line, Heading):
                match_list.update_entry(line.entry.id, _value_note(field))

    def _read_fields(self) -> None:
        self._offered_fields = dict(self.catalog.fields())

    def _search(self, *_text: object, keep_selection: bool = False) -> None:
        if not self.hasFocus():
            return
        if not keep_selection:
            if self.error_message:
                self.show_error("")
            self._read_fields()
        typed = self.text().strip()
        lines, count = self._lines(typed)
        matches = self.matches
        selected = matches.list.entry if keep_selection else None
        matches.list.show_lines(lines, selected.id if selected is not None else "")
        self._update_footer(count)
        self._position_matches(bool(lines))

    def _lines(self, typed: str) -> tuple[list[Line], int]:
        fields = [
            Entry(f"topic:{text}", text, ICONS[field.kind], _value_note(field))
            for text, field in self._offered_fields.items()
        ]
        if typed:
            matches, count = Finder(fields).find(typed, MAX_MATCHES)
        else:
            matches, count = [Match(entry) for entry in fields[:MAX_MATCHES]], len(fields)
        lines: list[Line] = [Heading(_("Fields")), *matches] if matches else []
        names = [example.split("(")[0] for example in EXAMPLE_EXPRESSIONS]
        example_field = next(iter(self._plotted_expressions()), None) or (
            matches[0].entry.text if matches else "/odom.speed"
        )
        calculated = [
            Entry(f"topic:{example.format(example_field)}", example.format(example_field), "square-function")
            for name, example in zip(names, EXAMPLE_EXPRESSIONS, strict=True)
            if not typed or name.startswith(typed.partition("(")[0])
        ]
        if calculated:
            lines += [Heading(_("Calculated")), *(Match(entry) for entry in calculated)]
        return lines, count

    def _update_footer(self, count: int) -> None:
        if self._matches is None:
            return
        hint = _("Tab completes; Enter adds to the left axis, Shift+Enter to the right one")
        count_text = ngettext("{count} field", "{count} fields", count).format(count=count)
        self._matches.footer.setText(self.error_message or f"{hint} · {count_text}")
        set_role(self._matches.footer, "error" if self.error_message else "textTertiary")

    def _position_matches(self, has_lines: bool) -> None:
        matches = self.matches
        if not has_lines and not self.error_message:
            matches.hide()
            return
        window = self.window()
        position = self.mapTo(window, QPoint(0, self.height() + 4))
        footer_size = matches.footer.sizeHint()
        width = min(
            max(round(self._theme.scaled(MATCHES_WIDTH)), footer_size.width() + 4), window.width() - 8
        )
        height = min(
            matches.list.content_height() + footer_size.height() + 12,
            round(self._theme.scaled(MATCHES_HEIGHT)),
        )
        height = min(height, window.height() - position.y() - 4)
        matches.setGeometry(
            min(position.x(), window.width() - width - 4), position.y(), width, max(60, height)
        )
        matches.show()
        matches.raise_()

    # -- keys ---------------------------------------------------------------------------------------------

    def event(self, event: QEvent) -> bool:
        # Tab completes; without a completion it moves the focus as usual.
        if (
            isinstance(event, QKeyEvent)
            and event.type() == QEvent.Type.KeyPress
            and event.key() == Qt.Key.Key_Tab
        ):
            completed = self._completed_text()
            if completed != self.text():
                self.setText(completed)
                self._search()
                return True
        return super().event(event)

    def _completed_text(self) -> str:
        typed = self.text()
        if not typed:
            return typed
        start = max(typed.rfind(sign) for sign in "( ,+*") + 1
        before, last = typed[:start], typed[start:]
        candidates = [
            *self._offered_fields,
            *self.catalog.topic_keys(),
            *(f"{name}(" for name in (*FUNCTIONS, *WINDOW_FUNCTIONS)),
        ]
        completed = complete(last, candidates) if last else last
        if completed == last and self._matches is not None and not start:
            entry = self._matches.list.entry
            if entry is not None and last and entry.text != last and match(last, entry.text) is not None:
                return entry.text
        return before + completed

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key()
        if key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._commit(right=bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier))
        elif key == Qt.Key.Key_Escape:
            self.clear()
            self.dispose()
            self.exited.emit()
        elif (
            key not in {Qt.Key.Key_Home, Qt.Key.Key_End}
            and self._matches is not None
            and self._matches.list.handle_key(key)
        ):
            return
        else:
            super().keyPressEvent(event)

    def _commit(self, *, right: bool) -> None:
        # A complete expression takes precedence over the selected match.
        typed = self.text().strip()
        entry = self._matches.list.entry if self._matches is not None and self._matches.isVisible() else None
        is_expression = typed in self._offered_fields or any(sign in typed for sign in "(+*") or " " in typed
        text = typed if is_expression or entry is None else entry.text
        if text:
            self.add_requested.emit(text, right)


def _value_note(field: PlottableField) -> str:
    if field.kind == "list":
        return ngettext("{count} curve", "{count} curves", field.count).format(count=field.count)
    return value_text(field.value)


SPAN_LABELS = {"12": lazy("12 s"), "60": lazy("1 min"), "300": lazy("5 min"), "all": lazy("All")}


class PlotTools(QWidget):
    """Toolbar of the plot, which wraps in a narrow panel.

    Args:
        session: Session with the topics.
        plotted_expressions: Returns the expressions of existing curves.
    """

    def __init__(
        self, theme: Theme, session: Session, plotted_expressions: Callable[[], Iterable[str]]
    ) -> None:
        super().__init__()
        self.add = AddCurveField(theme, session, plotted_expressions)
        self.span = Segments(
            theme,
            [(value, _(SPAN_LABELS[value]), None) for value, _s in SPANS],
            "60",
            size="small",
            name=_("Time range shown"),
        )
        self.cursors = ToggleButton(theme, _("Cursors"), "ruler")
        self.states = ToggleButton(theme, _("States"), "rows-3")
        self.states.setChecked(True)
        self.xy_toggle = ToggleButton(theme, _("X and Y"), "chart-spline")
        self.xy_toggle.setToolTip(plain.tip(_("Plot the second curve against the first")))
        self.xy_toggle.setProperty("tip", True)
        self.export = MenuButton(theme, _("Export"), "download", size="small")
        row = Flow(self, gap=8, row_gap=6)
        row.setContentsMargins(10, 6, 10, 6)
        row.add_elastic(self.add, is_greedy=True)
        row.push()
        self._curve_tools = (self.span, self.cursors, self.states, self.xy_toggle, self.export)
        for widget in self._curve_tools:
            row.addWidget(widget)

    def update_tools(self, curve_count: int, numeric_count: int) -> None:
        """Show the tools that apply to the current curves.

        Args:
            curve_count: Number of curves.
            numeric_count: Number of curves with numeric values.
        """
        for widget in self._curve_tools:
            paint.show_when(widget, curve_count > 0)
        paint.show_when(self.states, curve_count > numeric_count)
        paint.show_when(self.xy_toggle, numeric_count > 1)
