"""History strip of the inspector, for viewing earlier messages of a topic."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.core.messages.history import MessageHistory
from app.core.series.feed import SeriesFeed
from app.core.timeline.times import clock_text
from app.ui.theme.theme import Theme
from app.ui.widgets import FixedWidthLabel, IconButton
from app.ui.widgets.inputs.slider import SliderTrack
from app.ui.widgets.paint import show_when
from nep.i18n import _
from nep.messages.message import Message

UPDATE_TICKS = 6
"""Number of ticks (at 30 Hz) between updates of the message count."""


class HistoryStrip(QWidget):
    """Strip that collects the messages of a topic and lets the user select one of them.

    Attributes:
        history: Collected messages.
        selected_number: Number of the selected message; None while the newest one is selected.

    Signals:
        selection_changed: The user selected another message.
    """

    selection_changed = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.history = MessageHistory()
        self.selected_number: int | None = None
        self._feed: SeriesFeed | None = None
        self._topic = ""
        self._last_state: tuple[int, int, int | None] = (0, 0, None)
        self._ticks = 0
        self.back = IconButton(theme, "step-back", _("Previous message"), size=24)
        self.track = SliderTrack(theme, 0)
        self.track.setAccessibleName(_("Messages of this topic"))
        self.forward = IconButton(theme, "step-forward", _("Next message"), size=24)
        self.newest = IconButton(theme, "chevron-last", _("Follow the newest message"), size=24)
        self.text_label = FixedWidthLabel("small", "textSecondary")
        self.back.clicked.connect(lambda: self.step(-1))
        self.forward.clicked.connect(lambda: self.step(1))
        self.newest.clicked.connect(lambda: self.select(None))
        self.track.valueChanged.connect(self._slider_moved)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 2, 8, 2)
        row.setSpacing(3)
        row.addWidget(self.back)
        row.addWidget(self.track, 2)
        row.addWidget(self.forward)
        row.addWidget(self.newest)
        row.addWidget(self.text_label, 3)
        self.hide()

    def start(self, feed: SeriesFeed, topic: str) -> None:
        """Start collecting the messages of a topic. A change of the topic clears the history.

        Args:
            feed: Source of the messages.
            topic: Name of the topic; "" for none.
        """
        self.pause()
        if topic != self._topic:
            self.history.reset()
            self.selected_number = None
        self._feed, self._topic = feed, topic
        if topic:
            feed.register(topic, self.history, is_lossless=False)

    def pause(self) -> None:
        """Stop collecting messages until the next `start`. The collected messages remain available."""
        if self._feed is not None:
            self._feed.unregister(self._topic, self.history)
            self._feed = None

    def reset(self) -> None:
        """Stop collecting messages and clear the history; called when the source changes."""
        self.pause()
        self._topic = ""
        self.history.reset()
        self.selected_number = None
        self.refresh(at_once=True)

    def selected_message(self) -> Message | None:
        """Return the selected message; None if the newest is selected or the message has been evicted."""
        return self.history.at(self.selected_number) if self.selected_number is not None else None

    def previous_message(self) -> Message | None:
        """Return the message before the selected one.

        None if the newest message is selected or the message has been evicted.
        """
        return self.history.at(self.selected_number - 1) if self.selected_number is not None else None

    def step(self, by: int) -> None:
        """Select another message.

        Args:
            by: Number of messages to move by; negative for earlier messages. A step beyond the last
                message selects the newest message and follows later ones.
        """
        if not len(self.history):
            return
        target = (self.selected_number if self.selected_number is not None else self.history.end - 1) + by
        self.select(None if target >= self.history.end else self.history.nearest(target))

    def select(self, number: int | None) -> None:
        """Select a message by its number.

        Args:
            number: Number of the message; None selects the newest message and follows later ones.
        """
        if number != self.selected_number:
            self.selected_number = number
            self.refresh(at_once=True)
            self.selection_changed.emit()

    def clamp_selection(self) -> None:
        """Select the newest message if the selected one no longer exists because the replay was rewound."""
        if self.selected_number is not None and self.selected_number >= self.history.end:
            self.selected_number = None

    def refresh(self, *, at_once: bool = False, is_busy: bool = False) -> None:
        """Update the strip; call on every refresh.

        Args:
            at_once: True to update now instead of every `UPDATE_TICKS`.
            is_busy: True if other parts of the panel are repainted in this refresh. Otherwise the strip is
                updated half as often.
        """
        self._ticks += 1
        self.clamp_selection()
        messages = self.history
        state = (messages.first, messages.end, self.selected_number)
        is_needed = len(messages) > 1 or self.selected_number is not None
        interval_ticks = UPDATE_TICKS if is_busy else 2 * UPDATE_TICKS
        is_due = at_once or is_needed is self.isHidden() or self._ticks >= interval_ticks
        if state == self._last_state or not is_due:
            return
        self._last_state, self._ticks = state, 0
        show_when(self, is_needed)
        self.track.blockSignals(True)
        self.track.setRange(0, max(0, len(messages) - 1))
        index = (
            messages.nearest(self.selected_number) - messages.first
            if self.selected_number is not None and len(messages)
            else len(messages) - 1
        )
        if not self.track.isSliderDown():
            self.track.setValue(max(0, index))
        self.track.blockSignals(False)
        self.track.update()
        self.back.setEnabled(index > 0)
        self.forward.setEnabled(self.selected_number is not None)
        self.newest.setEnabled(self.selected_number is not None)
        self.text_label.setText(self._position_text(index))

    def _position_text(self, index: int) -> str:
        if self.selected_number is None:
            return _("the newest of {count}").format(count=len(self.history))
        message = self.selected_message()
        if message is None:
            return _("no longer available")
        text = _("{place} of {count}").format(place=index + 1, count=len(self.history))
        if message.stamp_ns is not None and 0 <= message.stamp_ns < 2**62:
            text = f"{text}   {clock_text(message.stamp_ns)}"
        return text

    def _slider_moved(self, index: int) -> None:
        is_last = index >= len(self.history) - 1
        self.select(None if is_last else self.history.first + index)
