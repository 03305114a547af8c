"""The strip with which a person goes back through the messages of a topic."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.core.messages.history import MessageHistory
from app.core.recording.replay.scale import clock_words
from app.core.series.feed import SeriesFeed
from app.ui.theme.theme import Theme
from app.ui.widgets import FixedWidthLabel, IconButton
from app.ui.widgets.inputs.slider import Track
from app.ui.widgets.paint import show_when
from nep.i18n import _
from nep.messages.message import Message

SAYS_EVERY = 6
"""Refreshes of 30 a second: figures that nobody waits for."""


class HistoryStrip(QWidget):
    """Keeps what comes on a topic, and which of it is shown: the newest, or one that a person went to.

    `moved` when a person went to another message; `at` is its number then, None for the newest.
    """

    moved = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.kept = MessageHistory()
        self.at: int | None = None
        self._feed: SeriesFeed | None = None
        self._topic = ""
        self._said: tuple[int, int, int | None] = (0, 0, None)
        self._ticks = 0
        self.back = IconButton(theme, "step-back", _("Previous message"), size=24)
        self.track = Track(theme, 0)
        self.track.setAccessibleName(_("Messages of this topic"))
        self.on = IconButton(theme, "step-forward", _("Next message"), size=24)
        self.newest = IconButton(theme, "chevron-last", _("Follow the newest message"), size=24)
        self.words = FixedWidthLabel("small", "textSecondary")
        self.back.clicked.connect(lambda: self.step(-1))
        self.on.clicked.connect(lambda: self.step(1))
        self.newest.clicked.connect(lambda: self.go(None))
        self.track.valueChanged.connect(self._slid)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 2, 8, 2)
        row.setSpacing(3)
        row.addWidget(self.back)
        row.addWidget(self.track, 2)
        row.addWidget(self.on)
        row.addWidget(self.newest)
        row.addWidget(self.words, 3)
        self.hide()

    def begin(self, feed: SeriesFeed, topic: str) -> None:
        """Keep what comes on this topic; of another one than before begin anew."""
        self.pause()
        if topic != self._topic:
            self.kept.rewind()
            self.at = None
        self._feed, self._topic = feed, topic
        if topic:
            feed.join(topic, self.kept, deep=False)

    def pause(self) -> None:
        """Keep nothing more, until `begin`; what is kept stays."""
        if self._feed is not None:
            self._feed.leave(self._topic, self.kept)
            self._feed = None

    def forget(self) -> None:
        """Another source is shown: nothing that was kept is of it."""
        self.pause()
        self._topic = ""
        self.kept.rewind()
        self.at = None
        self.say(at_once=True)

    def shown(self) -> Message | None:
        """The message that a person went to; None while the newest is shown, or it has left meanwhile."""
        return self.kept.at(self.at) if self.at is not None else None

    def before(self) -> Message | None:
        """The message before the one that a person went to, as far as it is kept."""
        return self.kept.at(self.at - 1) if self.at is not None else None

    def step(self, by: int) -> None:
        """Go on by so many messages; beyond the last one the newest is followed again."""
        if not len(self.kept):
            return
        wanted = (self.at if self.at is not None else self.kept.end - 1) + by
        self.go(None if wanted >= self.kept.end else self.kept.nearest(wanted))

    def go(self, number: int | None) -> None:
        """Show the message of this number, None: the newest, from now on."""
        if number != self.at:
            self.at = number
            self.say(at_once=True)
            self.moved.emit()

    def follow(self) -> None:
        """Leave a message that is to come once more: the source is at another time now."""
        if self.at is not None and self.at >= self.kept.end:
            self.at = None

    def say(self, *, at_once: bool = False, beside: bool = False) -> None:
        """Show where it is among what is kept; call it with every refresh, ``beside`` if more is painted."""
        self._ticks += 1
        self.follow()
        kept = self.kept
        state = (kept.first, kept.end, self.at)
        is_there = len(kept) > 1 or self.at is not None
        waits = SAYS_EVERY if beside else 2 * SAYS_EVERY
        due = at_once or is_there is self.isHidden() or self._ticks >= waits
        if state == self._said or not due:
            return
        self._said, self._ticks = state, 0
        show_when(self, is_there)
        self.track.blockSignals(True)
        self.track.setRange(0, max(0, len(kept) - 1))
        place = kept.nearest(self.at) - kept.first if self.at is not None and len(kept) else len(kept) - 1
        if not self.track.isSliderDown():
            self.track.setValue(max(0, place))
        self.track.blockSignals(False)
        self.track.update()
        self.back.setEnabled(place > 0)
        self.on.setEnabled(self.at is not None)
        self.newest.setEnabled(self.at is not None)
        self.words.setText(self._words(place))

    def _words(self, place: int) -> str:
        if self.at is None:
            return _("the newest of {count}").format(count=len(self.kept))
        message = self.shown()
        if message is None:
            return _("no longer available")
        words = _("{place} of {count}").format(place=place + 1, count=len(self.kept))
        if message.stamp_ns is not None and 0 <= message.stamp_ns < 2**62:
            words = f"{words}   {clock_words(message.stamp_ns)}"
        return words

    def _slid(self, place: int) -> None:
        last = place >= len(self.kept) - 1
        self.go(None if last else self.kept.first + place)
