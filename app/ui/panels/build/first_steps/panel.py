"""First steps panel: list of the tutorial's steps, with a hint for the next one."""

from __future__ import annotations

import time
from collections.abc import Callable

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QLabel, QSizePolicy, QStackedWidget, QVBoxLayout, QWidget

from app.core.projects.examples import example_block_ids
from app.errors import SettingsError
from app.intents import PointAtBlock
from app.ui.intents import HideBlockHint, PointAtButton
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.build.first_steps.steps import (
    START_BLOCK,
    STEPS,
    TutorialBlocks,
    TutorialState,
    TutorialStep,
    completed_steps,
    find_tutorial_blocks,
)
from app.ui.panels.home import TabHome
from app.ui.theme.style_sheet import STEP_MARK_SIZE
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Chip, EmptyAction, EmptyState, label, paint
from app.ui.widgets.labels import set_role
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from nep.i18n import _, lazy, pgettext

HINT_DELAY_S = 20.0
ALL_DONE_TEXT = lazy("First steps done")
DETACHED_HINT = lazy("Drag it up until it snaps below “{start}”.")
WHAT_NEXT_TEXT = lazy("You can now build, run and stop a behaviour. Open an example to learn more.")


class _StepMark(QLabel):
    """Check mark of a completed step, or the step's number in a circle, filled for the next step."""

    def __init__(self, theme: Theme, number: int) -> None:
        super().__init__()
        self._theme, self._number = theme, number
        self.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.setProperty("kind", "caption")
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self.show_state("later")
        theme.changed.connect(self._update_contents)

    def show_state(self, state: str) -> None:
        """Show the mark in the state "done", "next" or "later"."""
        paint.set_style_property(self, "state", state)
        self._update_contents()

    def sizeHint(self) -> QSize:
        side = round(self._theme.scaled(STEP_MARK_SIZE))
        return QSize(side, side)

    def _update_contents(self) -> None:
        if self.property("state") == "done":
            side = self.sizeHint().width() - 2
            icon = self._theme.icon("circle-check", "ok")
            self.setPixmap(icon.pixmap(QSize(side, side), self.devicePixelRatioF()))
        else:
            self.setText(str(self._number))


class StepRow(QWidget):
    """Row of one step. The next step is tinted, and shows a hint and a button.

    Args:
        number: Number of the step, counted from 1.
        step: Step to show.
        show_me: Called with the step when the button is clicked.
    """

    def __init__(
        self, theme: Theme, number: int, step: TutorialStep, show_me: Callable[[TutorialStep], None]
    ) -> None:
        super().__init__()
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.step = step
        self.mark = _StepMark(theme, number)
        self.text_label = label(with_block_names(step.text), "bodyLarge", wrap=True)
        self.hint = label(with_block_names(step.hint), "body", role="textSecondary", wrap=True)
        is_robot_step = step.id == "robot"
        self.button = Button(
            theme, with_block_names(step.text) if is_robot_step else _("Show me"), size="small"
        )
        self.button.clicked.connect(lambda: show_me(step))
        for text_label in (self.text_label, self.hint):
            text_label.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        help_row = QHBoxLayout()
        help_row.setSpacing(8)
        help_row.addWidget(self.hint, 1)
        help_row.addWidget(self.button, 0, Qt.AlignmentFlag.AlignTop)
        text = QVBoxLayout()
        text.setSpacing(4)
        text.addWidget(self.text_label)
        text.addLayout(help_row)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 5, 8, 5)
        row.setSpacing(10)
        row.addWidget(self.mark, 0, Qt.AlignmentFlag.AlignTop)
        row.addLayout(text, 1)

    def show_state(self, state: str) -> None:
        """Show the step in the state "done", "next" or "later"."""
        self.mark.show_state(state)
        paint.show_when(self.hint, state == "next")
        paint.show_when(self.button, state == "next")
        set_role(self.text_label, "textSecondary" if state == "done" else "text")
        template = {"done": _("{step}: done"), "next": _("{step}: the next step"), "later": "{step}"}[state]
        self.setAccessibleName(template.format(step=self.text_label.text()))
        paint.set_style_property(self, "state", state)

    def show_hint(self, *, is_detached: bool) -> None:
        """Show where to find the block; if `is_detached` is True, that it must be attached to the script."""
        self.hint.setText(with_block_names(DETACHED_HINT if is_detached else self.step.hint))


def with_block_names(text: str) -> str:
    """Translate a text of a step and insert the names of its blocks."""
    return _(text).format(
        start=pgettext("block", "when started"), say=pgettext("robot", "say"), turn=pgettext("robot", "turn")
    )


class FirstStepsPanel(PanelWidget):
    """Panel with the six steps to a robot that speaks, turns and stops. Progress is saved in the settings.

    The hint appears by itself after 20 s without progress.

    Args:
        clock: Returns the time in s.
    """

    def __init__(self, context: PanelContext, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__(context, _("First steps"))
        self._clock = clock
        step_ids = frozenset(step.id for step in STEPS)
        self.completed_ids: frozenset[str] = step_ids.intersection(self.session.settings.completed_steps)
        self._step_start: tuple[str, float] | None = None
        self._highlighted_step = ""
        self._last_activity: object = None
        self._cached_blocks: tuple[object, TutorialBlocks] = (None, TutorialBlocks())
        self.rows = [
            StepRow(self.theme, number, step, self.show_me) for number, step in enumerate(STEPS, start=1)
        ]
        steps = ScrollColumn(_("First steps"), margins=(8, 8, 8, 8), gap=2)
        for index, row in enumerate(self.rows):
            steps.column.insertWidget(index, row)
        self.end_page = EmptyState(
            self.theme,
            "circle-check",
            _(ALL_DONE_TEXT),
            _(WHAT_NEXT_TEXT),
            [
                EmptyAction(_("Open an example"), lambda: context.run("help.examples"), is_primary=True),
                EmptyAction(_("Start over"), self.start_again),
            ],
        )
        self.pages: QStackedWidget = self.make_page_stack(steps, self.end_page)
        self.chip = Chip(self.theme, "", "off")
        self.chips = [self.chip]
        self._restart_action = QAction(_("Start over"), self)
        self._restart_action.triggered.connect(self.start_again)
        self._show()

    def more_actions(self) -> tuple[QAction, ...]:
        return (self._restart_action,)

    def next_step(self) -> TutorialStep | None:
        """Return the next step, or None after the last one."""
        return next((step for step in STEPS if step.id not in self.completed_ids), None)

    # -- checking -----------------------------------------------------------------------------------------

    def refresh(self) -> None:
        if self.next_step() is None:
            return
        completed = completed_steps(self._current_state(), self.completed_ids)
        if completed != self.completed_ids:
            self.completed_ids = completed
            self._save_progress()
            self._show()
            if self.next_step() is None:
                paint.announce(self, _(ALL_DONE_TEXT))
        self._show_delayed_hint()

    def _current_state(self) -> TutorialState:
        runs, project = self.session.runs, self.session.document
        is_own_run = runs.document is project
        revision = (project.key, project.revision, project.edits, project.fixes)
        if self._cached_blocks[0] != revision:
            self._cached_blocks = (revision, find_tutorial_blocks(project.workspace, example_block_ids()))
            for row in self.rows:
                row.show_hint(
                    is_detached=bool(row.step.block_suffix)
                    and row.step.block_suffix in self._cached_blocks[1].detached_suffixes
                )
        return TutorialState(
            can_speak=any(
                action.name == "say" for link in self.session.fleet.connected for action in link.robot.actions
            ),
            blocks=self._cached_blocks[1],
            executed_ids=runs.ran_blocks,
            was_stopped=is_own_run and bool(runs.stopped_blocks) and not runs.active,
        )

    def _show_delayed_hint(self) -> None:
        # Shown once per step.
        step, now_s = self.next_step(), self._clock()
        activity = (self.session.document.edits, self.session.runs.active)
        if step is None:
            return
        if self._step_start is None or self._step_start[0] != step.id or activity != self._last_activity:
            if self._step_start is not None and self._step_start[0] != step.id and self._highlighted_step:
                self._clear_highlight()
            self._step_start, self._last_activity = (step.id, now_s), activity
        elif now_s - self._step_start[1] >= HINT_DELAY_S and self._highlighted_step != step.id:
            if step.id != "robot" and not self.session.runs.active:
                self.show_me(step)
            self._highlighted_step = step.id

    def _show(self) -> None:
        step = self.next_step()
        had_focus = any(row.button.hasFocus() for row in self.rows)
        for row in self.rows:
            state = "done" if row.step.id in self.completed_ids else "next" if row.step is step else "later"
            row.show_state(state)
        count = len(self.completed_ids)
        self.chip.set(
            _("{done} of {all}").format(done=count, all=len(STEPS)), "ok" if count == len(STEPS) else "off"
        )
        self.pages.setCurrentIndex(0 if step is not None else 1)
        button = next((row.button for row in self.rows if row.step is step), None)
        if had_focus and button is not None:  # keeps the focus for keyboard users
            button.setFocus(Qt.FocusReason.OtherFocusReason)

    def _save_progress(self) -> None:
        try:
            self.session.settings.completed_steps = tuple(
                step.id for step in STEPS if step.id in self.completed_ids
            )
        except SettingsError as error:
            self.session.console.add("warn", "studio", str(error))

    # -- user actions -------------------------------------------------------------------------------------

    def show_me(self, step: TutorialStep) -> None:
        """Highlight the block or button of a step; for the first step, start the virtual robot."""
        self._highlighted_step = step.id
        if step.id == "robot":
            self.context.run("robots.virtual")
        elif step.block_suffix:
            self.context.request(PointAtBlock(self._block_type(step.block_suffix)))
        else:
            self.context.request(PointAtButton(step.button_command))

    def _block_type(self, suffix: str) -> str:
        if suffix == START_BLOCK:
            return START_BLOCK
        blocks = self.session.documents.definitions().get("blocks")
        types = [str(each.get("type", "")) for each in blocks] if isinstance(blocks, list) else []
        return next((kind for kind in types if kind.endswith(suffix)), suffix)

    def _clear_highlight(self) -> None:
        self._highlighted_step = ""
        self.context.request(HideBlockHint())

    def start_again(self) -> None:
        """Restart the tutorial in a new behaviour; existing blocks are not changed."""
        self.completed_ids = frozenset()
        self._step_start = None
        self._save_progress()
        if self.session.document.has_blocks:
            self.context.run("file.new")
        self._show()

    def suspend(self) -> None:
        super().suspend()
        if self._highlighted_step:
            self._clear_highlight()


PANEL = Panel(
    "first_steps",
    lazy("First steps"),
    "lightbulb",
    (),
    FirstStepsPanel,
    home=(TabHome("behaviour", "camera", min_height=400),),
)
