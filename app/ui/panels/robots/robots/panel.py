"""Robots panel: forms for trying the actions of each robot."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import (
    QApplication,
    QHBoxLayout,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from app.core.robots.motion.permission import MayNotMoveError
from app.core.robots.robot_link import NOT_STOPPED, STOPPING
from app.errors import AppError, InputProblem, RobotInputError
from app.ui.intents import ShowRobot
from app.ui.panels.base import Panel, PanelContext
from app.ui.panels.command import Command, IntentHandler
from app.ui.panels.home import TabHome
from app.ui.panels.no_robot import NoRobotController
from app.ui.panels.one_robot_panel import OneRobotPanel
from app.ui.panels.robots.robots.action_card import ActionCard
from app.ui.panels.robots.robots.list import RobotList
from app.ui.text.numbers import group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Chip,
    ElidedLabel,
    EmptyAction,
    EmptyState,
    SearchField,
    Separator,
    label,
    paint,
)
from app.ui.widgets.file_dialogs import FileDialogs
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.indicators import STATUS_BY_ROBOT_STATE
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from nep.i18n import _, lazy, ngettext

if TYPE_CHECKING:
    from app.core.messages.image_streams import ImageStream
    from app.core.network.watches import Suspendable
    from app.core.robots.robot_link import RobotLink
    from app.core.session import Session

EXPANDED_CARD_COUNT = 4
LIST_MIN_WIDTH = 760
HEADER_MIN_WIDTH_WITH_FINDER = 620
FINDER_MIN_WIDTH, FINDER_MAX_WIDTH = 110, 180
HEADER_GAP = 10
PICTURE_CODEC = "image"


class RobotHeader(QWidget):
    """Header with name and state of the selected robot, a search field for actions, and a Stop button.

    In a narrow header the search field shrinks first, then the description of the robot is hidden.
    """

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.name = label("", "heading")
        self.chip = Chip(theme)
        self.about = ElidedLabel("body", "textSecondary")
        self.finder = SearchField(theme, _("Find an action"))
        self.finder.setFixedWidth(FINDER_MAX_WIDTH)
        self.finder.setMinimumHeight(theme.size("control", "form"))
        self.stop = Button(theme, _("Stop"), "square", kind="stop", size="large")
        self.stop.has_filled_icon = True
        self._row = row = Flow(self, gap=HEADER_GAP)
        row.setContentsMargins(16, 7, 16, 8)
        row.addWidget(self.name)
        row.addWidget(self.chip)
        row.add_elastic(self.about)
        row.push()
        row.addWidget(self.finder)
        row.addWidget(self.stop)

    def event(self, event: QEvent) -> bool:
        if event.type() in {QEvent.Type.LayoutRequest, QEvent.Type.Resize}:
            self._fit()
        return super().event(event)

    def _fit(self) -> None:
        shows_finder = self.width() >= self._theme.scaled(HEADER_MIN_WIDTH_WITH_FINDER)
        margins = self._row.contentsMargins()
        others_width = sum(each.sizeHint().width() + HEADER_GAP for each in (self.name, self.chip, self.stop))
        room = self.width() - margins.left() - margins.right() - others_width
        about_width = self.about.sizeHint().width()
        min_finder_width = FINDER_MIN_WIDTH + HEADER_GAP if shows_finder else 0
        shows_about = about_width + min_finder_width <= room
        if shows_about:
            room -= about_width + HEADER_GAP
        self.finder.setFixedWidth(max(FINDER_MIN_WIDTH, min(FINDER_MAX_WIDTH, room)))
        paint.show_when(self.finder, shows_finder)
        paint.show_when(self.about, shows_about)


class SessionImageSource:
    """Source of images for forms: image topics of the session, and files."""

    def __init__(self, session: Session, files: FileDialogs) -> None:
        self._session, self._files = session, files
        self._open_streams: list[ImageStream] = []

    @property
    def streams(self) -> Sequence[ImageStream]:
        """Open streams."""
        self._open_streams = [stream for stream in self._open_streams if not stream.is_closed]
        return self._open_streams

    def topics(self) -> Sequence[str]:
        """Return the names of available image topics."""
        return sorted(
            t.name for t in self._session.live.topics if t.codec == PICTURE_CODEC and t.gone_s is None
        )

    def open_stream(self, topic: str) -> ImageStream:
        """Subscribe to the images of a topic; the caller closes the stream."""
        stream = self._session.live.images.stream(topic)
        self._open_streams = [*self.streams, stream]
        return stream

    def prompt_file(self, folder: str, callback: Callable[[Path], None]) -> None:
        """Show the dialog for choosing an image file.

        Args:
            folder: Initial folder; "" for the user's pictures.
            callback: Receives the path of the file.
        """
        self._files.open_picture(folder, callback)


class RobotsPanel(OneRobotPanel):
    """Panel with the list of robots and the action cards of the selected one."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Robots"))
        self._names: list[str] = []  # names of the robots in the list
        self.cards: dict[str, ActionCard] = {}
        self._cards_robot_name = ""
        self._pictures = SessionImageSource(self.session, self.context.files)
        self._shown_values: dict[str, tuple[object, ...]] = {}
        self._last_sensor_values: dict[tuple[str, str], list[str]] = {}
        self._lay_out()
        application = QApplication.instance()
        if isinstance(application, QApplication):
            application.focusChanged.connect(self._focus_changed)

    # -- construction -------------------------------------------------------------------------------------

    def _lay_out(self) -> None:
        theme = self.theme
        title = _("No robot is connected")
        text = _("A robot's actions appear here once it is connected.")
        start = EmptyAction(
            _("Use the virtual robot"), lambda: self.context.run("robots.virtual"), "bot", is_primary=True
        )
        self.empty = EmptyState(theme, "bot", title, text, [start])
        self._no_robot = NoRobotController(self.empty, title, text, [start])
        self._no_robot.set_starting(self.session.starting_robots)
        self.list = RobotList(theme, self.context.run)
        self.list.selected.connect(self.select_robot)
        self.list.discard_requested.connect(self.discard)
        self.items = self.list.items
        self._list_line = Separator(theme, upright=True)
        right = QVBoxLayout()
        right.setSpacing(0)
        self.head = header = RobotHeader(theme)
        self.name, self.chip, self.about = header.name, header.chip, header.about
        self.finder, self.stop = header.finder, header.stop
        self.finder.textChanged.connect(self._apply_filter)
        self.stop.clicked.connect(lambda: self.session.runs.stop_robot(self._robot))
        right.addWidget(header)
        right.addWidget(Separator(theme))
        right.addWidget(self._make_cards(), 1)
        robot = QWidget()
        robot.setLayout(right)
        right.setContentsMargins(0, 0, 0, 0)
        self.pages = QStackedWidget()
        self.pages.addWidget(self.empty)
        self.pages.addWidget(robot)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.list)
        row.addWidget(self._list_line)
        row.addWidget(self.pages, 1)

    def _make_cards(self) -> QWidget:
        scroll = ScrollColumn(_("Actions"), margins=(16, 14, 16, 14), gap=12)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAsNeeded)
        self._card_column = scroll.column
        self.no_match_label = label(_("No matching actions."), "bodyLarge", role="textSecondary")
        self.no_match_label.hide()
        self._card_column.insertWidget(0, self.no_match_label)
        return scroll

    # -- display ------------------------------------------------------------------------------------------

    def fleet_changed(self) -> None:
        self._names = self.list.show_fleet(self.session.fleet)
        self.pages.setCurrentIndex(1 if self._names else 0)
        self._fit()

    def robot_to_show(self) -> RobotLink | None:
        """Return the robot to show, or None if the list is empty.

        This is the robot selected in this panel if it is still listed, else the robot shown in other
        panels, else the first robot in the list.
        """
        fleet, names = self.session.fleet, self._names
        if self._robot in names:
            return fleet.link(self._robot)
        current = fleet.current
        return (
            current
            if current is not None and current.name in names
            else fleet.link(names[0])
            if names
            else None
        )

    def refresh_robot(self, link: RobotLink | None) -> None:
        for name, item in self.items.items():
            item_link = self.session.fleet.link(name)
            if item_link is not None and self._has_changed(name, item_link.state):
                item.show_link(item_link, self.list.last_seen_text(name))
        if link is not None:
            self._show_link(link)
        else:
            self._no_robot.set_starting(self.session.starting_robots)

    def _has_changed(self, key: str, *now: object) -> bool:
        # Returns True if the value differs from the one that was shown last.
        has_changed = self._shown_values.get(key) != now
        self._shown_values[key] = now
        return has_changed

    def discard(self, name: str) -> None:
        """Remove a disconnected robot from the list until it connects again."""
        self.session.fleet.known_robots.discard(name)
        self._shown_values.pop(name, None)
        self._revision = -1
        self.refresh()

    def select_robot(self, name: str) -> None:
        """Select a robot for this panel and all other panels that display a single robot."""
        self.session.fleet.select(name)
        link = self.session.fleet.link(name)
        if link is not None:
            self.switch_to(link)

    def show_robot(self, link: RobotLink) -> None:
        self._shown_values.pop("cards", None)
        if link.name in self.items:
            self.items[link.name].setChecked(True)
        self._make_forms()

    def _make_forms(self) -> None:
        link = self.session.fleet.link(self._robot)
        if link is None or not self._has_changed("cards", link.name, link.robot, self._offered_values(link)):
            return
        inputs = (
            {name: card.form.input() for name, card in self.cards.items()} if self._has_cards_of(link) else {}
        )
        self._remove_cards()
        actions = [action for action in link.robot.actions if action.name != link.robot.safe_stop.action]
        titles = {action.name: action.title for action in link.robot.actions}
        for index, action in enumerate(actions):
            card = ActionCard(
                self.theme,
                action,
                self._options,
                is_collapsed=index >= EXPANDED_CARD_COUNT,
                pictures=self._pictures,
                title_of=lambda name: titles.get(name, name.replace("_", " ")),
            )
            card.form.set_input(inputs.get(action.name, {}))
            card.try_requested.connect(lambda values, name=action.name: self.start_action(name, values))
            card.cancel_requested.connect(
                lambda name=action.name: self.session.fleet.cancel(self._robot, name)
            )
            self.cards[action.name] = card
            self._card_column.insertWidget(index, card)
        self._cards_robot_name = link.name
        self._set_highlighted(next(iter(self.cards.values()), None))
        self.name.setText(link.name)
        self.stop.set_label(_("Stop {robot}").format(robot=link.name))
        count = len(actions)
        if link.is_virtual:
            about = ngettext("virtual, {count} action", "virtual, {count} actions", count)
        else:
            about = ngettext("{count} action", "{count} actions", count)
        self.about.setText(about.format(count=group_digits(count)))
        self._apply_filter()

    def _has_cards_of(self, link: RobotLink) -> bool:
        # Returns True if the cards belong to this robot, so that their typed input can be kept.
        return self._cards_robot_name == link.name

    def _remove_cards(self) -> None:
        for card in self.cards.values():
            card.form.dispose()
            self._card_column.removeWidget(card)
            card.deleteLater()
        self.cards = {}
        self._shown_values = {
            key: value for key, value in self._shown_values.items() if not key.startswith("card ")
        }

    def _offered_values(self, link: RobotLink) -> tuple[object, ...]:
        # The forms are rebuilt when the offered values change.
        option_sources = {
            parameter.options_from for action in link.robot.actions for parameter in action.parameters
        }
        return tuple((name, tuple(self._options(name))) for name in sorted(filter(None, option_sources)))

    def _show_link(self, link: RobotLink) -> None:
        self._make_forms()
        if self._has_changed("head", link.state, link.chip_text):
            self.chip.set(link.state_label, STATUS_BY_ROBOT_STATE[link.state])
        may_move = link.state in {NOT_STOPPED, STOPPING}
        for name, card in self.cards.items():
            invocation = link.invocations.get(name)
            now = (
                (invocation.id, invocation.state, invocation.feedback, int(invocation.elapsed_s * 5))
                if invocation is not None
                else ()
            )
            if self._has_changed(f"card {name}", may_move, *now):
                card.show_invocation(invocation, may_move=may_move)
                card.show_tries(tuple(link.past_invocations))

    def _options(self, name: str) -> Sequence[str]:
        # Values that a property of the robot offers.
        link = self.session.fleet.link(self._robot)
        value = link.values.get(name) if link is not None else None
        if isinstance(value, (list, tuple)):
            self._last_sensor_values[self._robot, name] = [str(item) for item in value]
        return self._last_sensor_values.get(
            (self._robot, name), []
        )  # the last known values, while the watch is suspended

    def _apply_filter(self) -> None:
        keywords = self.finder.text().casefold().split()
        visible_count = 0
        for name, card in self.cards.items():
            text = f"{name} {card.action.title} {card.action.category}".casefold()
            is_match = all(keyword in text for keyword in keywords)
            card.setVisible(is_match)
            visible_count += is_match
        self.no_match_label.setVisible(bool(self.cards) and not visible_count)

    # -- user actions -------------------------------------------------------------------------------------

    def start_action(self, action: str, values: Mapping[str, object]) -> None:
        """Start an action of the selected robot. Errors are shown in the card of the action.

        Args:
            action: Name of the action.
            values: Input by parameter name.
        """
        card = self.cards[action]
        try:
            self.session.fleet.invoke(self._robot, action, values)
        except RobotInputError as error:
            card.show_problems(error.problems)
        except MayNotMoveError:
            card.show_problems(())  # the window shows the confirmation
        except AppError as error:
            card.show_problems((InputProblem("", str(error)),))
        else:
            card.show_problems(())

    def _focus_changed(self, _old: QWidget | None, new: QWidget | None) -> None:
        if new is not None and self.isAncestorOf(new):
            for card in self.cards.values():
                if card.isAncestorOf(new):
                    self._set_highlighted(card)

    def _set_highlighted(self, highlighted_card: ActionCard | None) -> None:
        for card in self.cards.values():
            card.set_highlighted(card is highlighted_card)

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit()

    def theme_changed(self) -> None:
        super().theme_changed()
        self._fit()

    def _fit(self) -> None:
        width = self.width() / self.theme.scaled(1.0)
        count = self.list.count
        is_list_visible = count > 1 or (count == 1 and width >= LIST_MIN_WIDTH)
        self.list.setVisible(is_list_visible)
        self._list_line.setVisible(is_list_visible)

    def focus_filter(self) -> bool:
        self.finder.setFocus(Qt.FocusReason.ShortcutFocusReason)
        return True

    def suspendables(self) -> Iterable[Suspendable | None]:
        return (self._watch, *self._pictures.streams)

    def dispose(self) -> None:
        super().dispose()
        for card in self.cards.values():
            card.form.dispose()


PANEL = Panel(
    "robots",
    lazy("Robots"),
    "bot",
    (),
    RobotsPanel,
    home=(TabHome("behaviour", "behaviour"), TabHome("developer", "topics")),
    commands=(
        Command(
            "robots.show",
            lazy("Try what a robot can do"),
            lambda _panel: None,
            "Robots",
            icon="eye",
            separator_above=True,
            after="robots.room",
        ),
    ),
    intents=(IntentHandler(ShowRobot, lambda panel, intent: panel.select_robot(intent.name)),),
)
