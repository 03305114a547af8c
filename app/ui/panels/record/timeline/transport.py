"""Transport controls of a replay: position, play, step, speed, loop and bookmark."""

from __future__ import annotations

from collections.abc import Callable
from math import exp, log, log10

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.core.recording.replay.replay import Replay
from app.core.timeline.times import clock_text, date_text, duration_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Switch, ToggleButton, label
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.slider import SliderTrack
from app.ui.widgets.labels import set_role
from nep.i18n import _
from nep.recordings.player import SPEED_MAX, SPEED_MIN, PlayerStatus

SPEED_STEP_COUNT = 40
MIN_NORMAL_SPEED_RATIO = 0.97
"""Ratio of actual to requested speed below which the actual speed is displayed."""


class TransportRow(QWidget):
    """Row of controls that shows and changes the state of a replay."""

    bookmark_requested = Signal()
    arm_requested = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._replay: Replay | None = None
        self.time, self.length, self.date = (
            label("", "code"),
            label("", "body", role="textSecondary"),
            label("", "body", role="textSecondary"),
        )
        self.previous = IconButton(theme, "skip-back", _("Previous bookmark"), "Ctrl+Left")
        self.back = IconButton(theme, "step-back", _("Previous message of the selected topic"))
        self.play = Button(theme, _("Play"), "play", kind="primary")
        self.forward = IconButton(theme, "step-forward", _("Next message of the selected topic"))
        self.next = IconButton(theme, "skip-forward", _("Next bookmark"), "Ctrl+Right")
        self.speed = SliderTrack(theme, SPEED_STEP_COUNT)
        self.speed.setAccessibleName(_("Speed"))
        self.speed.setValue(SPEED_STEP_COUNT // 2)
        self.speed.setMaximumWidth(110)
        self.speed_label = label("", "code", role="textSecondary")
        self.loop = ToggleButton(theme, _("Loop"), "repeat")
        self.bookmark = Button(theme, _("Bookmark"), "bookmark", size="small")
        self.armed = Switch(theme, _("Armed"))
        self.sending_off_label = label(_("Sending is off"), "small", role="textSecondary")
        self._build()
        self._connect()

    def _build(self) -> None:
        flow = Flow(self, gap=8, row_gap=4)
        flow.setContentsMargins(12, 6, 12, 6)
        for widget in (
            self.time, self.length, self.date, self.previous, self.back, self.play, self.forward, self.next,
            self.speed, self.speed_label, self.loop, self.bookmark,
        ):  # fmt: skip
            flow.addWidget(widget)
        flow.push()
        flow.addWidget(self.armed)
        flow.addWidget(self.sending_off_label)

    def set_armed(self, *, is_armed: bool) -> None:
        """Hide the arming switch while sending is armed, because the arming strip then shows a switch too.

        Args:
            is_armed: True while sending is armed.
        """
        self.armed.setVisible(not is_armed)
        self.sending_off_label.setVisible(not is_armed)

    def _request_arming(self) -> None:
        self.armed.setChecked(False)  # becomes checked once topics are chosen
        self.arm_requested.emit()

    def _connect(self) -> None:
        self.armed.clicked.connect(self._request_arming)
        self.previous.clicked.connect(
            lambda: self._apply_to_replay(lambda replay: replay.skip(forward=False))
        )
        self.next.clicked.connect(lambda: self._apply_to_replay(lambda replay: replay.skip(forward=True)))
        self.back.clicked.connect(lambda: self._apply_to_replay(lambda replay: replay.step(forward=False)))
        self.forward.clicked.connect(lambda: self._apply_to_replay(lambda replay: replay.step(forward=True)))
        self.play.clicked.connect(lambda: self._apply_to_replay(Replay.toggle))
        self.loop.clicked.connect(lambda: self._apply_to_replay(Replay.toggle_loop))
        self.bookmark.clicked.connect(self.bookmark_requested)
        self.speed.valueChanged.connect(
            lambda step: self._apply_to_replay(lambda replay: replay.set_speed(speed_of(step)))
        )
        self.speed.reset.connect(lambda: self.speed.setValue(SPEED_STEP_COUNT // 2))

    def _apply_to_replay(self, action: Callable[[Replay], object]) -> None:
        if self._replay is not None:
            action(self._replay)

    def show_replay(self, replay: Replay, player: PlayerStatus) -> None:
        """Show the state of a replay.

        Args:
            replay: Open recording.
            player: Position, speed and state of the player.
        """
        if replay is not self._replay:
            self._replay = replay
            self.speed.blockSignals(True)
            self.speed.setValue(step_of(player.speed))
            self.speed.blockSignals(False)
        self.time.setText(duration_text(player.position_ns - replay.start_ns))
        self.length.setText(
            _("of {length}").format(length=duration_text(replay.end_ns - replay.start_ns, digits=0))
        )
        at_ns = player.position_ns
        self.date.setText(f"{date_text(at_ns)}, {clock_text(at_ns)}")
        text, icon = (_("Pause"), "pause") if player.is_playing else (_("Play"), "play")
        self.play.set_label(text, icon)
        self.play.set_kind("plain" if player.is_playing else "primary")
        self.loop.setChecked(player.is_looping)
        self.loop.set_label(self._loop_text(replay, player))
        self._update_speed(player)

    def _loop_text(self, replay: Replay, player: PlayerStatus) -> str:
        if player.loop is None or not player.is_looping:
            return _("Loop")
        begin, end = (duration_text(each - replay.start_ns, digits=0) for each in player.loop)
        return _("Loop {begin} to {end}").format(begin=begin, end=end)

    def _update_speed(self, player: PlayerStatus) -> None:
        requested, actual = player.speed, player.measured_speed
        is_slow = player.is_playing and actual is not None and actual < MIN_NORMAL_SPEED_RATIO * requested
        if is_slow:
            text = _("requested {asked}, actual {true} \u00d7").format(
                asked=f"{requested:.3g}", true=f"{actual:.2g}"
            )
        else:
            text = f"{requested:.1f}\u2009\u00d7" if requested >= 1 else f"{requested:.2g}\u2009\u00d7"
        if text != self.speed_label.text():
            self.speed_label.setText(text)
            set_role(self.speed_label, "warn" if is_slow else "textSecondary")


def speed_of(step: int) -> float:
    """Return the speed for a slider step: 0.1 at the left end, 1 in the middle, 10 at the right end."""
    return round(SPEED_MIN * exp(log(SPEED_MAX / SPEED_MIN) * step / SPEED_STEP_COUNT), 2)


def step_of(speed: float) -> int:
    """Return the slider step for a speed, rounded to the nearest step."""
    return round(
        log10(max(SPEED_MIN, min(SPEED_MAX, speed)) / SPEED_MIN)
        / log10(SPEED_MAX / SPEED_MIN)
        * SPEED_STEP_COUNT
    )
