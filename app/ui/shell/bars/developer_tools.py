"""Tools at the left of the tool bar: record, save the flight recorder, freeze, source, layouts, panels."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtWidgets import QWidget

from app.core.recording.recordings import SessionRecordings
from app.core.session import Session
from app.core.timeline.times import duration_text
from app.ui.shell.actions.actions import Actions
from app.ui.shell.bars.run_bar import GAP, ToolBar
from app.ui.shell.commands.commands import Commands
from app.ui.shell.commands.freeze import all_frozen, freeze_buttons
from app.ui.shell.commands.shell import Shell
from app.ui.text import plain
from app.ui.text.numbers import length_text, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, MenuButton, Separator, ToggleButton, assign_command, paint
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

FREEZE_COMMAND, RECORD_COMMAND, KEEP_COMMAND = "view.freeze", "recording.toggle", "recording.keep"
REFRESH_HALF_TICKS = 8  # refresh interval in half ticks
IDLE_STATES = frozenset({"ready", "proven", "unanswered"})  # run states in which tools may reappear
RECORD_BUTTON_WIDTH_PX = (
    146  # fixed width of the record button, so that nothing moves when a recording starts
)
MIN_WIDTH_WITH_KEEP_PX = 1340  # width of the whole bar at 100 % text
MIN_WIDTH_WITH_LAYOUTS_PX = 940  # width with the layout and panel menus, but without Keep
MIN_WIDTH_WITH_RECORD_TEXT_PX = 680  # below this the record button shows only its dot
MIN_WIDTH_WITH_FREEZE_PX = 548
MIN_WIDTH_WITH_RECORD_PX = 520  # below this the result of a stop would be cut
MIN_WIDTH_WITH_SOURCE_PX = 1120  # width with the source switch, which is also in the File menu
MIN_WIDTH_DURING_REPLAY_PX = 1240  # width with the layout and panel menus while a recording is open


class RecordButton(Button):
    """Button that starts a recording and shows the duration and size of the current recording."""

    def __init__(self, theme: Theme) -> None:
        super().__init__(theme, _("Record"), "circle-dot", size="small")
        self.icon_role = "error"
        self._is_icon_only = False

    def set_icon_only(self, is_icon_only: bool) -> None:
        """Show only the icon if `is_icon_only`, else the icon and the text."""
        if is_icon_only != self._is_icon_only:
            self._is_icon_only = is_icon_only
            self.updateGeometry()
            self.update()

    def displayed_text(self) -> str:
        return "" if self._is_icon_only else self.text()

    def show_recording(self, recordings: SessionRecordings) -> None:
        """Show the duration and size of the current recording, or "Record" if there is none."""
        self.set_kind("recording" if recordings.is_recording else "plain")
        if not recordings.is_recording:
            self.set_label(_("Record"))
            return
        length = length_text(recordings.elapsed_s)
        size = size_text(recordings.client.state.size_bytes)
        text = _("{length}, {size}").format(length=length, size=size)
        if text != self.text():
            self.set_label(text)
            self.setAccessibleName(_("Recording"))

    def sizeHint(self) -> QSize:
        height = super().sizeHint().height()
        icon_width = self.icon_side() + 2 * self.metrics.padding
        return QSize(
            icon_width if self._is_icon_only else round(self._theme.scaled(RECORD_BUTTON_WIDTH_PX)), height
        )


LIVE_ICON, RECORDING_ICON = "radio-tower", "history"


class SourceSwitch(MenuButton):
    """Menu button to switch between the live network and a recording.

    Attributes:
        back: Button that returns to the live network, shown while a recording is the source.
    """

    def __init__(self, theme: Theme, session: Session, actions: Actions) -> None:
        super().__init__(theme, _("Live network"), LIVE_ICON, size="small")
        self._session, self._actions = session, actions
        self._is_recording = False
        self.back = Button(theme, _("Back to live"), LIVE_ICON, size="small")
        for button in (self, self.back):
            button.allow_shrinking()
        actions.bind(self.back, "replay.live")
        self.clicked.connect(self._open_menu)

    @property
    def is_recording(self) -> bool:
        """True while a recording is the source."""
        return self._is_recording

    def refresh(self) -> None:
        """Update the text and icon to the current source."""
        replay = self._session.replay
        self._is_recording = replay is not None
        self.set_kind("replay" if self._is_recording else "plain")
        if replay is None:
            self.set_label(_("Live network"), LIVE_ICON)
            return
        is_loaded = replay.opened_recording is not None
        length = duration_text(replay.end_ns - replay.start_ns, digits=0) if is_loaded else ""
        self.set_label(f"{replay.name}  {length}".strip(), RECORDING_ICON)

    def _open_menu(self) -> None:
        menu = Menu(self._theme, self)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        menu.addActions([self._actions["replay.open"], self._actions["replay.live"]])
        open_below(menu, self)


class DeveloperTools(QObject):
    """Controller that adds the tools to the tool bar and updates them in `on_half_tick`."""

    def __init__(self, shell: Shell, bar: ToolBar, commands: Commands, session: Session) -> None:
        super().__init__(bar)
        self._shell, self._bar, self._actions = shell, bar, commands.actions
        self._recordings, self._runs = session.recordings, session.runs
        self._half_ticks = 0
        self._tools_hidden_for_space: list[QWidget] = []  # the most important one last
        theme, menus = shell.theme, commands.menus
        self.record = RecordButton(theme)
        self.keep = Button(theme, "", "history", size="small")
        assign_command(self.record, RECORD_COMMAND)
        self.record.clicked.connect(commands.recording.start_and_open_sheet)
        self._actions.bind(self.keep, KEEP_COMMAND)
        self.freeze = ToggleButton(theme, _("Freeze"), "snowflake")
        self.layout = MenuButton(theme, _("Developer"), "panel-left", size="small")
        self.panels = MenuButton(theme, _("Panels"), size="small")
        self.panels.setToolTip(plain.tip(_("Opens and closes panels")))
        self._actions.bind(self.freeze, FREEZE_COMMAND)
        self._actions[FREEZE_COMMAND].triggered.connect(self.refresh)
        self.layout.clicked.connect(lambda: menus.open_layout_menu(self.layout))
        self.panels.clicked.connect(lambda: menus.open_panel_menu(self.panels))
        self._wide_tools = (Separator(theme, upright=True, length=24), self.layout, self.panels)
        tools = (self.record, self.keep, self.freeze, *self._wide_tools)
        for index, tool in enumerate(tools):
            bar.add_tool(tool, index)
        for button in (self.record, self.keep, self.freeze, self.layout, self.panels):
            button.allow_shrinking()
        self.source = SourceSwitch(theme, commands.session, self._actions)
        for index, tool in enumerate((self.source, self.source.back), tools.index(self.freeze) + 1):
            bar.add_tool(tool, index)
        bar.installEventFilter(self)
        theme.changed.connect(self._fit)

    def refresh(self) -> None:
        """Update all tools to the state of the session."""
        was_recording = self.source.is_recording
        self.source.refresh()
        if self.source.is_recording != was_recording:
            self._fit()
        shell, is_frozen = self._shell, all_frozen(self._shell.bench)
        self._actions[FREEZE_COMMAND].setChecked(is_frozen)
        self.freeze.setChecked(is_frozen)
        self.freeze.setEnabled(bool(freeze_buttons(shell.bench)))
        self.record.show_recording(self._recordings)
        self.keep.set_label(_("Save last {count} s").format(count=self._recordings.ring_settings.seconds))
        custom_name = shell.saved_layouts.custom_name("developer")
        name = custom_name or _("Developer")
        self.layout.set_label(name)
        self.layout.setAccessibleName(_("Layout {name}").format(name=name))
        if self._runs.view().state in IDLE_STATES:
            self._show_tools_with_room()

    def eventFilter(self, _watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.Resize:
            self._fit()
        elif event.type() == QEvent.Type.LayoutRequest:
            self._hide_tools_without_room()
        return False

    def _fit(self) -> None:
        # Hides tools in this order if there is little room: Keep, source, layouts, Freeze, Record. All of
        # them are also in menus.
        width, scaled, is_recording = self._bar.width(), self._shell.theme.scaled, self.source.is_recording
        self._tools_hidden_for_space.clear()
        paint.show_when(self.keep, width >= scaled(MIN_WIDTH_WITH_KEEP_PX) and not is_recording)
        paint.show_when(self.source, is_recording or width >= scaled(MIN_WIDTH_WITH_SOURCE_PX))
        paint.show_when(self.source.back, is_recording)
        for tool in self._wide_tools:
            paint.show_when(
                tool,
                width >= scaled(MIN_WIDTH_DURING_REPLAY_PX if is_recording else MIN_WIDTH_WITH_LAYOUTS_PX),
            )
        self.record.set_icon_only(width < scaled(MIN_WIDTH_WITH_RECORD_TEXT_PX))
        paint.show_when(self.freeze, width >= scaled(MIN_WIDTH_WITH_FREEZE_PX))
        paint.show_when(self.record, width >= scaled(MIN_WIDTH_WITH_RECORD_PX))
        self._hide_tools_without_room()

    def _hide_tools_without_room(self) -> None:
        # Hides further tools if the run state, or the texts of the language, need more room. They stay hidden
        # during the run, so that the other tools don't move with every change of the run state.
        source = () if self.source.is_recording else (self.source,)
        for tool in (self.keep, *source, *self._wide_tools, self.freeze, self.record):
            if self._bar.needed_width() <= self._bar.width():
                break
            if not tool.isHidden():
                tool.hide()
                self._tools_hidden_for_space.append(tool)

    def _show_tools_with_room(self) -> None:
        while self._tools_hidden_for_space:
            tool = self._tools_hidden_for_space[-1]
            if self._bar.needed_width() + tool.sizeHint().width() + GAP > self._bar.width():
                break
            tool.show()
            del self._tools_hidden_for_space[-1]

    def on_half_tick(self) -> None:
        """Refresh the tools at regular intervals while the bar is visible; called on every half tick."""
        self._half_ticks += 1
        if self._half_ticks % REFRESH_HALF_TICKS == 0 and self._bar.isVisible():
            self.refresh()
