"""The left end of the tool bar: freeze what shows, its source, which layout this is, and its panels."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject
from PySide6.QtGui import QColor

from app.core.recording.replay.scale import span_words
from app.core.session import Session
from app.ui.shell.actions.actions import Actions
from app.ui.shell.bars.run_bar import ToolBar
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.freeze import all_frozen, freezable
from app.ui.shell.commands.shell import Shell
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, MenuButton, Separator, ToggleButton, paint
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _

FREEZE = "view.freeze"
EVERY = 8  # half ticks
ROOM_PX = 780  # what the whole bar needs at 100 % text
SOURCE_ROOM_PX = 960  # ... and with the source, which the View menu has, too
RECORDING_ROOM_PX = 1060  # ... and with the way back to the live network
FREEZE_ROOM_PX = 520  # below that nothing of what a stop brought would be whole beside it

LIVE_ICON, RECORDING_ICON = "radio-tower", "history"


class SourceSwitch(MenuButton):
    """Says what shows, and lets a person choose; `back` stands beside it while a recording shows."""

    def __init__(self, theme: Theme, session: Session, actions: Actions) -> None:
        super().__init__(theme, _("Live network"), LIVE_ICON, size="small")
        self._session, self._actions = session, actions
        self._is_recording = False
        self.back = Button(theme, _("Back to live"), LIVE_ICON, size="small")
        for button in (self, self.back):
            button.let_shrink()
        actions.bind(self.back, "replay.live")
        self.clicked.connect(self._drop)

    @property
    def is_recording(self) -> bool:
        """Whether a recording shows."""
        return self._is_recording

    def refresh(self) -> None:
        """Say what is so now."""
        replay = self._session.replay
        self._is_recording = replay is not None
        if replay is None:
            self.set_word(_("Live network"), LIVE_ICON)
            return
        there = replay.opened is not None
        length = span_words(replay.end_ns - replay.start_ns, digits=0) if there else ""
        self.set_word(f"{replay.name}  {length}".strip(), RECORDING_ICON)

    def _drop(self) -> None:
        menu = Menu(self._theme, self)
        menu.addActions([self._actions["replay.open"], self._actions["replay.live"]])
        drop_below(menu, self)

    def _look(self) -> tuple[QColor | None, QColor | None, QColor]:
        if self._is_recording and self.isEnabled():
            colour = self._theme.colour
            return colour("accentTint"), colour("accent"), colour("accentText")
        return super()._look()


class DeveloperTools(QObject):
    """Puts the tools into the tool bar; `follow` keeps them true."""

    def __init__(self, shell: Shell, bar: ToolBar, commands: Commands) -> None:
        super().__init__(bar)
        self._shell, self._bar, self._actions = shell, bar, commands.actions
        self._ticks = 0
        theme, menus = shell.theme, commands.menus
        self.freeze = ToggleButton(theme, _("Freeze"), "snowflake")
        self.layout = MenuButton(theme, _("Developer"), "panel-left", size="small")
        self.panels = MenuButton(theme, _("Panels"), size="small")
        self.panels.setToolTip(plain.tip(_("Opens and closes panels")))
        self._actions.bind(self.freeze, FREEZE)
        self._actions[FREEZE].triggered.connect(self.refresh)
        self.layout.clicked.connect(lambda: menus.drop_layouts(self.layout))
        self.panels.clicked.connect(lambda: menus.drop_panels(self.panels))
        self._wide_only = (Separator(theme, upright=True, length=24), self.layout, self.panels)
        tools = (self.freeze, *self._wide_only)
        for place, tool in enumerate(tools):
            bar.add_tool(tool, place)
        for button in (self.freeze, self.layout, self.panels):
            button.let_shrink()
        self.source = SourceSwitch(theme, commands.session, self._actions)
        for place, tool in enumerate((self.source, self.source.back), tools.index(self.freeze) + 1):
            bar.add_tool(tool, place)
        bar.installEventFilter(self)
        theme.changed.connect(self._fit)

    def refresh(self) -> None:
        """Say what is so now."""
        was_recording = self.source.is_recording
        self.source.refresh()
        if self.source.is_recording != was_recording:
            self._fit()
        shell, frozen = self._shell, all_frozen(self._shell.bench)
        self._actions[FREEZE].setChecked(frozen)
        self.freeze.setChecked(frozen)
        self.freeze.setEnabled(bool(freezable(shell.bench)))
        own = shell.saved_layouts.own("developer")
        name = own or _("Developer")
        self.layout.set_word(name)
        self.layout.setAccessibleName(_("Layout {name}").format(name=name))

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._fit()
        return False

    def _fit(self) -> None:
        """Large text in a narrow window: layouts and panels, then Freeze, are in the View menu."""
        scaled, recording = self._shell.theme.scaled, self.source.is_recording
        paint.show_when(self.source, recording or self._bar.width() >= scaled(SOURCE_ROOM_PX))
        paint.show_when(self.source.back, recording)
        room = self._bar.width() >= scaled(RECORDING_ROOM_PX if recording else ROOM_PX)
        for tool in self._wide_only:
            paint.show_when(tool, room)
        paint.show_when(self.freeze, self._bar.width() >= self._shell.theme.scaled(FREEZE_ROOM_PX))

    def follow(self) -> None:
        """Called with every half tick: say what is so, while it can be seen."""
        self._ticks += 1
        if self._ticks % EVERY == 0 and self._bar.isVisible():
            self.refresh()
