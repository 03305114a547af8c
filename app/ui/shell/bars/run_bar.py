"""The run bar of the Behaviour layout and the tool bar of the Developer layout: Run, Pause, Step, Stop."""

from __future__ import annotations

from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.core.run.view import RunView
from app.ui.shell.actions.actions import Actions
from app.ui.shell.bars.run_status import Bar, Mark, Result, Sentence
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, Line, RunButton, StopButton, label, paint
from app.ui.widgets.menus import Menu, drop_below

ROOM_PX = 960  # what the bar needs at 100 % text
PACES = ("run.full_speed", "run.slow", "run.very_slow")
LEAST_ROOM_PX = 600  # below that even Run is an icon, so that nothing of a stop's result is cut


class RunBar(Bar):
    """60 px: three large buttons, what happens now, what the last stop brought, and Stop."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, theme.size("runBar"))
        self.setAccessibleName("Run and stop")
        self.run = RunButton(theme, "Run", "play", widest="Go on")
        self.pause = RunButton(theme, "Pause", "pause")
        self.step = RunButton(theme, "Step", "step-forward")
        self.pace = IconButton(theme, "gauge", "Speed", checkable=True, size=36)
        self._paces = Menu(theme, self, "Speed")
        self.mark = Mark(theme)
        self.sentence = Sentence(theme)
        self.result = Result(theme)
        self.confirm = Button(theme, "", size="large")
        self.confirm.hide()
        self.confirm.let_shrink(96)
        self.stop = StopButton(theme)
        self._build(theme)
        self.pace.clicked.connect(lambda: drop_below(self._paces, self.pace))
        theme.changed.connect(self._fit)

    def _build(self, theme: Theme) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 4, 8, 5)
        row.setSpacing(8)
        for button in (self.run, self.pause, self.step):
            row.addWidget(button)
        row.addSpacing(-4)
        row.addWidget(self.pace)
        row.addSpacing(-4)
        row.addWidget(Line(theme, upright=True, length=28))
        row.addSpacing(8)
        row.addWidget(self.mark)
        row.addWidget(self.sentence, 1)
        row.addWidget(self.confirm)
        row.addWidget(self.result)
        row.addSpacing(-4)
        row.addWidget(self.stop)

    def use(self, actions: Actions) -> None:
        """Let its buttons trigger these; the button for the speed offers full speed and slow motion."""
        bind(self, actions)
        self._paces.addActions([actions[name] for name in PACES])

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def _fit(self) -> None:
        """Large text in a narrow window: Pause and Step are icons in every state, then Run, too."""
        bare = self.width() < self._theme.scaled(ROOM_PX)
        self.run.set_bare(self.width() < self._theme.scaled(LEAST_ROOM_PX))
        self.pause.set_bare(bare)
        self.step.set_bare(bare)

    def show_view(self, view: RunView) -> None:
        """Show one of the six states."""
        self.run.set_word(view.run_word)
        self.run.set_filled(view.can_run)
        self.run.setEnabled(view.can_run)
        self.pause.setEnabled(view.can_pause)
        self.step.setEnabled(view.can_step)
        self.pace.setChecked(view.slow)
        self.mark.show_state(view.state)
        self.sentence.show_words(view.title, view.detail, is_alarm=view.state == "unanswered")
        self.result.show_view(view)
        self.confirm.set_word(view.confirm or "")
        paint.show_when(self.confirm, view.confirm is not None)
        self.stop.show_state(view.stop_word, ring=view.state == "stopping")


class ToolBar(Bar):
    """40 px: the same states, small, at the right end."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, theme.size("toolBar"))
        self.setAccessibleName("Tools, run and stop")
        self.mark = Mark(theme)
        self.words = label("", "body", role="textSecondary")
        self.result = Result(theme, compact=True)
        self.confirm = Button(theme, "", size="small")
        self.confirm.hide()
        self.confirm.let_shrink(96)
        self.run = Button(theme, "Run", "play", kind="run", size="small")
        self.run.fill_icon = True
        self.pause = IconButton(theme, "pause", "Pause")
        self.step = IconButton(theme, "step-forward", "Step")
        self.stop = StopButton(theme, "toolBar")
        self.tools = QHBoxLayout()
        self._build()

    def _build(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 0, 6, 1)
        row.setSpacing(8)
        self.tools.setSpacing(6)
        row.addLayout(self.tools)
        row.addStretch(1)
        row.addWidget(self.mark)
        row.addSpacing(-4)
        row.addWidget(self.words)
        row.addWidget(self.result)
        for button in (self.pause, self.step, self.confirm, self.run):
            row.addWidget(button)
        row.addSpacing(-4)
        row.addWidget(self.stop)

    def use(self, actions: Actions) -> None:
        """Let its buttons trigger these."""
        bind(self, actions)

    def add_tool(self, tool: QWidget, place: int = -1) -> None:
        """Put a button at the left end, at that place among those there, else after them."""
        self.tools.insertWidget(place, tool)

    def show_view(self, view: RunView) -> None:
        """Show one of the six states, small."""
        self.result.show_view(view)
        spoken = bool(self.result.text) and view.state in {"proven", "unanswered"}
        self.mark.show_state(view.state)
        self.mark.setVisible(not spoken)
        self.words.setText(view.compact)
        self.words.setVisible(not spoken)
        self.run.set_word(view.run_word)
        self.run.setVisible(view.can_run)
        self.pause.setVisible(view.can_pause)
        self.step.setVisible(view.can_step and view.state in {"running", "paused"})
        self.confirm.set_word(view.confirm or "")
        paint.show_when(self.confirm, view.confirm is not None)
        self.stop.show_state(view.stop_word, ring=view.state == "stopping")


def bind(bar: RunBar | ToolBar, actions: Actions) -> None:
    """Run, Pause, Step, Stop and the button that confirms: in both bars they are the same commands."""
    actions.bind(bar.run, "run.run")
    actions.bind(bar.pause, "run.pause")
    actions.bind(bar.step, "run.step")
    actions.bind(bar.stop, "run.stop")
    bar.confirm.clicked.connect(actions["run.confirm"].trigger)
