"""Start page: continue with open behaviours, use a robot, create a behaviour, open an example or file."""

from __future__ import annotations

import datetime as dt
import itertools
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QRect, Qt, QTimer, Signal
from PySide6.QtGui import QKeySequence, QResizeEvent, QShortcut
from PySide6.QtWidgets import (
    QBoxLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QSizePolicy,
    QSpacerItem,
    QVBoxLayout,
    QWidget,
)

from app.core.projects.examples import ABOUT, NAME
from app.core.storage.atomic_file import read_regular_file
from app.core.storage.settings import RecentFile
from app.ui.shell.start_page.art import EmptyPageArt, RobotArt, StepsArt
from app.ui.shell.start_page.cards import DevelopersLine, ExampleCard, RecentRow, StartCard
from app.ui.shell.start_page.open_work import OpenWork, OpenWorkList
from app.ui.shell.start_page.preview import Row, rows
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, label, paint
from app.ui.widgets.buttons import LinkButton
from nep.i18n import _, lazy, ngettext, translate

WIDTH, MARGIN, CARD_GAP = 1080, 24, 16
TOP_MARGIN = 35
BANNER_ROOM, TALL_PAGE_HEIGHT, BANNER_GAP, BANNER_LINE = 40, 640, 6, 29
"""Space above the question for an alert, so that it covers no text; a low page has space for one line.

Values are in px at 100 % text.
"""
EXAMPLES_PER_ROW = 4
EXAMPLES_MARGIN = 60  # margin in px when scrolling to the examples, so that their heading is visible
ALL_EXAMPLES_TEXTS = {
    5: lazy("All five examples"),
    6: lazy("All six examples"),
    7: lazy("All seven examples"),
    8: lazy("All eight examples"),
    9: lazy("All nine examples"),
    10: lazy("All ten examples"),
}
"""Texts of the link to all examples, by the number of examples, which is spelled out."""
MAX_RECENT = 3
FIRST_CARD_STRETCH, OTHER_CARD_STRETCH = 408, 318  # relative widths of the first card and the others
LEARN_TEXTS = (
    lazy("Learn in five minutes"),
    lazy("Six steps to a robot that speaks and turns. Each is checked off as you go."),
)
OFFER_TEXTS = (
    lazy("First steps (five minutes)"),
    lazy("New here? Six steps to a robot that speaks and turns. Each is checked off as you go."),
)


@dataclass(frozen=True)
class Example:
    """Example that is shipped with Studio.

    Attributes:
        path: File of the example.
        name: Translated name.
        text: Translated description.
        rows: First blocks, for the preview.
    """

    path: Path
    name: str
    text: str
    rows: tuple[Row, ...]


def read_examples(folder: Path) -> tuple[Example, ...]:
    """Return the examples in a folder, sorted by file name; invalid files are skipped."""
    examples = []
    for path in sorted(folder.glob("*.nepb")) if folder.is_dir() else []:
        try:
            data = json.loads(read_regular_file(path))
            workspace = data["workspace"]
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            continue
        if isinstance(workspace, dict):
            name = translate(NAME, str(data.get("name", path.stem)))
            text = translate(ABOUT, str(data.get("description", "")))
            examples.append(Example(path, name, text, rows(workspace)))
    return tuple(examples)


def all_examples_text(count: int) -> str:
    """Return the text of the link to all examples, such as "All six examples"."""
    if count in ALL_EXAMPLES_TEXTS:
        return _(ALL_EXAMPLES_TEXTS[count])
    return ngettext("The only example", "All {count} examples", count).format(count=count)


class StartPage(QWidget):
    """Page that is shown at startup, with the ways to start or continue work.

    Signals are emitted for the user's choices.
    """

    virtual_robot_pressed = Signal()
    new_behaviour_pressed = Signal()
    example_selected = Signal(object)
    file_selected = Signal(object)
    learn_pressed = Signal()
    open_pressed = Signal()
    developer_pressed = Signal()
    work_selected = Signal(str)
    exited = Signal()  # Esc was pressed

    def __init__(self, theme: Theme, examples: Sequence[Example], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._theme, self.examples = theme, tuple(examples)
        self.setAccessibleName(_("Start"))
        self.open_work = OpenWorkList(theme)
        self.open_work.selected.connect(self.work_selected)
        exit_shortcut = QShortcut(QKeySequence(Qt.Key.Key_Escape), self)
        exit_shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
        exit_shortcut.activated.connect(self.exited)
        self._use_button = Button(theme, _("Use the virtual robot"), "bot", kind="primary", size="large")
        self._use_button.clicked.connect(self.virtual_robot_pressed)
        self._new_button = Button(theme, _("New behaviour"), size="large")
        self._new_button.clicked.connect(self.new_behaviour_pressed)
        self.robot_card = StartCard(
            theme,
            RobotArt(theme),
            _("Connect a robot"),
            _("A virtual Pepper comes with Studio. You can use it now and connect a real one later."),
            [self._use_button],
        )
        self.new_card = StartCard(
            theme,
            EmptyPageArt(theme),
            _("Create a behaviour"),
            _("Start with an empty page and your robot's blocks."),
            [self._new_button],
        )
        self._learn_button = Button(theme, _("First steps"), size="large")
        self._learn_button.clicked.connect(self.learn_pressed)
        self._decline_button = Button(theme, _("Cancel"), kind="ghost", size="large")
        self._decline_button.clicked.connect(self._decline)
        self._decline_button.hide()
        title, text = LEARN_TEXTS
        self.learn_card = StartCard(
            theme, StepsArt(theme), _(title), _(text), [self._learn_button, self._decline_button]
        )
        self._is_offering_first_steps = False
        self._shows_all = False
        self._recent_box = QWidget()
        self._open_button = Button(theme, _("Open a file"), "folder-open", kind="ghost", size="normal")
        self._open_button.clicked.connect(self.open_pressed)
        self._build(examples)
        theme.changed.connect(self._restyle)
        theme.changed.connect(self._fit_room)
        theme.changed.connect(self._fit_cards)
        self._restyle()

    def _restyle(self) -> None:
        # the style sheet sets size and weight, but can't set letter spacing
        self._question.setFont(self._theme.font("display"))

    def _build(self, examples: Sequence[Example]) -> None:
        content = QWidget()
        content.setProperty("bare", "true")
        content.setMaximumWidth(WIDTH)
        column = self._content = QVBoxLayout(content)
        column.setContentsMargins(0, TOP_MARGIN, 0, 24)
        column.setSpacing(0)
        self._banner_room = QSpacerItem(0, 0, QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Fixed)
        column.addSpacerItem(self._banner_room)
        self._question = label(_("What would you like to do?"), "display", wrap=True)
        column.addWidget(self._question)
        column.addSpacing(7)
        lead = _("Combine blocks to make a robot speak and act. No programming needed.")
        column.addWidget(label(lead, "lead", role="textSecondary", wrap=True))
        column.addSpacing(24)
        column.addWidget(self.open_work)
        cards = self._cards = QBoxLayout(QBoxLayout.Direction.LeftToRight)
        cards.setSpacing(CARD_GAP)
        for index, card in enumerate(self._ordered_cards()):
            cards.addWidget(card, OTHER_CARD_STRETCH if index else FIRST_CARD_STRETCH)
        column.addLayout(cards)
        column.addSpacing(26)
        self._all_button = LinkButton(self._theme, all_examples_text(len(examples)), "arrow-right")
        self._all_button.clicked.connect(lambda: self.show_all(not self._shows_all))
        header = self._heading_row(label(_("Open an example"), "heading"), self._open_button)
        header.addSpacing(8)
        header.addWidget(self._all_button)
        column.addLayout(header)
        column.addSpacing(10)
        column.addLayout(self._example_grid(examples))
        column.addSpacing(22)
        recent = QVBoxLayout(self._recent_box)
        recent.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._recent_box)
        column.addStretch(1)
        self._add_scroll_area(content)

    def _add_scroll_area(self, content: QWidget) -> None:
        # Centred in a scroll area, with the line for developers below it.
        middle = QWidget()
        middle.setProperty("bare", "true")
        row = QHBoxLayout(middle)
        row.setContentsMargins(MARGIN, 0, MARGIN, 0)
        row.addStretch(1)
        row.addWidget(content, 1000)
        row.addStretch(1)
        area = self._area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        area.viewport().setAutoFillBackground(False)
        line = DevelopersLine(self._theme)
        line.developer_pressed.connect(self.developer_pressed)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(area, 1)
        column.addWidget(line)
        area.setWidget(middle)  # the last step, because it styles the contents
        content.installEventFilter(self)

    def banner_area(self) -> QRect:
        """Return the area for an alert, above the heading of the page."""
        height = TOP_MARGIN + self._banner_room.sizeHint().height() - 2 * BANNER_GAP
        return QRect(BANNER_GAP, BANNER_GAP, self.width() - 2 * BANNER_GAP, height)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_room()
        self._fit_cards()

    def event(self, event: QEvent) -> bool:
        handled = super().event(event)
        if event.type() in {QEvent.Type.LayoutRequest, QEvent.Type.FontChange, QEvent.Type.Polish}:
            self._fit_cards()
        return handled

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        # The scroll area doesn't pass on that the contents need another size.
        if event.type() == QEvent.Type.LayoutRequest:
            self._fit_cards()
        return super().eventFilter(watched, event)

    def _fit_room(self) -> None:
        min_room = round(self._theme.scaled(BANNER_LINE)) + 2 * BANNER_GAP - TOP_MARGIN
        room = max(BANNER_ROOM if self.height() >= TALL_PAGE_HEIGHT else 0, min_room)
        if room != self._banner_room.sizeHint().height():
            self._banner_room.changeSize(0, room, QSizePolicy.Policy.Minimum, QSizePolicy.Policy.Fixed)
            self._content.invalidate()

    def _fit_cards(self) -> None:
        # If there is little room, cards are stacked, then lose their images, so that the first button is
        # visible.
        cards = (self.robot_card, self.new_card, self.learn_card)
        row_width = sum(card.minimumSizeHint().width() for card in cards) + CARD_GAP * (len(cards) - 1)
        fits_in_row = row_width <= min(WIDTH, self.width() - 2 * MARGIN)
        direction = QBoxLayout.Direction.LeftToRight if fits_in_row else QBoxLayout.Direction.TopToBottom
        if self._cards.direction() != direction:
            self._cards.setDirection(direction)
        for card in cards:
            card.art.setVisible(fits_in_row or self.height() >= TALL_PAGE_HEIGHT)

    def _ordered_cards(self) -> list[StartCard]:
        # The first card is the widest and has the primary button.
        cards = [self.robot_card, self.new_card]
        cards.insert(0 if self._is_offering_first_steps else len(cards), self.learn_card)
        return cards

    @property
    def offers_first_steps(self) -> bool:
        """True if the card with the first steps is the primary one."""
        return self._is_offering_first_steps

    def offer_first_steps(self, is_offered: bool = True) -> None:
        """Make the card with the first steps the primary one if `is_offered`, else one of three equals."""
        if is_offered == self._is_offering_first_steps:
            return
        self._is_offering_first_steps = is_offered
        had_focus = self._decline_button.hasFocus()
        self._learn_button.set_kind("primary" if is_offered else "plain")
        self._use_button.set_kind("plain" if is_offered else "primary")
        title, text = OFFER_TEXTS if is_offered else LEARN_TEXTS
        self.learn_card.set_texts(_(title), _(text))
        self.learn_card.set_accented(is_offered)
        paint.show_when(self._decline_button, is_offered)
        cards = self._ordered_cards()
        for index, card in enumerate(cards):
            self._cards.removeWidget(card)
            self._cards.insertWidget(index, card, OTHER_CARD_STRETCH if index else FIRST_CARD_STRETCH)
        for before, after in itertools.pairwise(
            [each for card in cards for each in card.findChildren(Button)]
        ):
            QWidget.setTabOrder(before, after)
        if had_focus:
            self.focus_first()

    def _decline(self) -> None:
        self.offer_first_steps(False)

    def _heading_row(self, title: QLabel, button: Button | None = None) -> QHBoxLayout:
        row = QHBoxLayout()
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(title)
        row.addStretch(1)
        if button is not None:
            row.addWidget(button)
        return row

    def _example_grid(self, examples: Sequence[Example]) -> QGridLayout:
        grid = QGridLayout()
        grid.setSpacing(16)
        self.example_cards: list[ExampleCard] = []
        for index, example in enumerate(examples):
            card = ExampleCard(self._theme, example.path, example.name, example.text, example.rows)
            card.clicked.connect(lambda _on=False, path=example.path: self.example_selected.emit(path))
            grid.addWidget(card, index // EXAMPLES_PER_ROW, index % EXAMPLES_PER_ROW)
            self.example_cards.append(card)
        for column in range(EXAMPLES_PER_ROW):
            grid.setColumnStretch(column, 1)
        self.show_all(False)
        return grid

    def show_all(self, visible: bool) -> None:
        """Show all examples if `visible`, else only the first row."""
        self._shows_all = visible
        for card in self.example_cards[EXAMPLES_PER_ROW:]:
            paint.show_when(card, visible)
        paint.show_when(self._all_button, len(self.example_cards) > EXAMPLES_PER_ROW)
        text = _("Fewer examples") if visible else all_examples_text(len(self.example_cards))
        self._all_button.set_label(text, None if visible else "arrow-right")

    def focus_examples(self) -> None:
        """Show all examples and focus the first one."""
        self.show_all(True)
        if self.example_cards:
            self.example_cards[0].setFocus(Qt.FocusReason.OtherFocusReason)
            # Deferred, because cards and page have no geometry before they are shown.
            QTimer.singleShot(0, self, self._scroll_to_examples)

    def _scroll_to_examples(self) -> None:
        # Prefers the first rows if not all examples fit.
        for card in (self.example_cards[-1], self.example_cards[0]):
            self._area.ensureWidgetVisible(card, 0, EXAMPLES_MARGIN)

    def show_recent(self, recent: Sequence[RecentFile], now: dt.datetime | None = None) -> None:
        """Set the recent files; the section is hidden if there are none.

        Args:
            recent: Recent files, the last opened one first.
            now: Current time, for the formatted dates; default: the system time.
        """
        moment = now if now is not None else dt.datetime.now().astimezone()
        layout = self._recent_box.layout()
        if layout is None:
            return
        while (item := layout.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.deleteLater()
        self.recent_rows: list[RecentRow] = []
        paint.show_when(self._recent_box, bool(recent))
        paint.show_when(self._open_button, not recent)
        if not recent:
            return
        other = Button(self._theme, _("Open a file"), "folder-open", kind="ghost")
        other.clicked.connect(self.open_pressed)
        header = QWidget()
        header.setLayout(self._heading_row(label(_("Recent"), "heading"), other))
        layout.addWidget(header)
        container = QWidget()
        row = QHBoxLayout(container)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        for file in recent[:MAX_RECENT]:
            recent_row = RecentRow(self._theme, file, moment)
            recent_row.clicked.connect(lambda _on=False, path=file.path: self.file_selected.emit(path))
            row.addWidget(recent_row, 1)
            self.recent_rows.append(recent_row)
        for _place in range(MAX_RECENT - len(recent[:MAX_RECENT])):
            row.addStretch(1)
        layout.addWidget(container)

    def show_robot(self, chip: str, status: str) -> None:
        """Set text and status of the chip on the card "Connect a robot"; an empty text hides the chip."""
        self.robot_card.chip.set(chip, status)

    def show_open(self, items: Sequence[OpenWork]) -> None:
        """Set the open behaviours; the section is hidden if there are none.

        If there are any, the card with the first steps is no longer the primary one.
        """
        self.open_work.show_work(items)
        if items:
            self.offer_first_steps(False)

    def focus_first(self) -> None:
        """Scroll to the top and focus the first open behaviour or, if there is none, the primary button."""
        self._area.verticalScrollBar().setValue(0)
        rows = self.open_work.rows
        first = self._learn_button if self._is_offering_first_steps else self._use_button
        (rows[0] if rows else first).setFocus(Qt.FocusReason.OtherFocusReason)
