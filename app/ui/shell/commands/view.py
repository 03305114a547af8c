"""How a person likes Studio: palette, shortcuts, layouts with names, theme, text, motion, recent files.

Everything that opens over the window is made when it is first asked for, so that the start does not wait.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from app.core.storage.settings import RecentFile
from app.errors import SettingsError
from app.ui.shell.actions.shortcuts import Shortcuts
from app.ui.shell.actions.table import Actions, Handler
from app.ui.shell.commands.freeze import freeze_or_go_on
from app.ui.shell.commands.layout_tools import DeveloperTools
from app.ui.shell.commands.menus import MenuLists
from app.ui.shell.commands.palette_entries import Offers
from app.ui.shell.documents.controller import Files
from app.ui.shell.main_window import MainWindow
from app.ui.theme.system import Wish
from app.ui.theme.theme import Mode
from app.ui.widgets.lists.fuzzy import Entry
from app.ui.widgets.menus import Menu
from nep.system.lazy_import import later

if TYPE_CHECKING:
    from app.ui.shell.dialogs import command_palette, shortcuts
    from app.ui.shell.dialogs import name as name_sheet
    from app.ui.shell.dialogs import settings as settings_sheet
else:
    command_palette, name_sheet = (
        later("app.ui.shell.dialogs.command_palette"),
        later("app.ui.shell.dialogs.name"),
    )
    settings_sheet, shortcuts = (
        later("app.ui.shell.dialogs.settings"),
        later("app.ui.shell.dialogs.shortcuts"),
    )

TEXT_STEP = 25
PANEL_KEYS = range(1, 10)
UNTIL_END = "until Studio ends"
NEXT_LAYOUT = "Keep this layout as"


@runtime_checkable
class ChoosesRobot(Protocol):
    """A panel that can show one robot of many."""

    def choose(self, name: str) -> None:
        """Show the robot of that name."""


class Habits:
    """Handlers for the commands that concern the window itself, and its menus that change."""

    def __init__(self, window: MainWindow, files: Files) -> None:
        self._window, self._files, self._session = window, files, window.session
        self.shortcuts = Shortcuts(window.session.settings, window.complain)
        self._offers = Offers(window, self.shortcuts)
        self._palette: command_palette.Palette | None = None
        self._shortcut_sheet: shortcuts.ShortcutSheet | None = None
        self._name_sheet: name_sheet.NameSheet | None = None
        self._settings_sheet: settings_sheet.SettingsSheet | None = None

    def handlers(self) -> dict[str, Handler]:
        """What the commands of the table do."""
        window = self._window
        return {
            "palette.open": self.open_palette,
            "help.shortcuts": self.open_shortcuts,
            "settings.open": self.open_settings,
            "file.forget_recent": self._forget_recent,
            "layout.behaviour": lambda: self.show_layout("behaviour"),
            "layout.developer": lambda: self.show_layout("developer"),
            "layout.reset": self._reset,
            "layout.keep": self._keep_layout,
            "layout.rename": self._rename_layout,
            "layout.delete": self._delete_layout,
            "view.freeze": self._freeze,
            "panel.next": lambda: window.panel_focus.next(1),
            "panel.previous": lambda: window.panel_focus.next(-1),
            **{f"panel.{n}": lambda n=n: window.panel_focus.number(n) for n in PANEL_KEYS},  # type: ignore[misc]
            "theme.light": lambda: self._theme("light"),
            "theme.dark": lambda: self._theme("dark"),
            "theme.system": lambda: self._theme("system"),
            "theme.motion": self._motion,
            "theme.contrast": self._contrast,
            "text.larger": lambda: self._text(window.theme.text_percent + TEXT_STEP),
            "text.smaller": lambda: self._text(window.theme.text_percent - TEXT_STEP),
            "text.normal": lambda: self._text(100),
        }

    def use(self, actions: Actions, menus: dict[str, Menu]) -> None:
        """Keep these actions and menus up to date."""
        self.actions, window = actions, self._window
        self._lists = MenuLists(window, actions, menus, self._files.open)
        self.tools = DeveloperTools(window, self._lists, actions)
        self._lists.built_in, self._lists.own = self._built_in, self._use_layout
        window.bar.search.clicked.connect(self.open_palette)
        self.shortcuts.changed.connect(self._show_keys)
        window.bench_made.connect(self.shortcuts.tell)
        window.theme.changed.connect(self._mark)
        window.pages.currentChanged.connect(lambda _page: self._show_keys_here())
        self._show_keys()
        self._mark()

    def _show_keys(self) -> None:
        self._show_keys_here()
        self._window.bar.search.show_key(self.shortcuts.first("palette.open"))
        self.shortcuts.tell()

    def _show_keys_here(self) -> None:
        """Finding blocks has its key where blocks are seen; elsewhere it is the panels' own."""
        here = self._window.pages.currentWidget() is self._window.benches.get("behaviour")
        self.actions.set_keys(lambda name: self.shortcuts.of(name) if here or name != "blocks.find" else ())

    def _mark(self) -> None:
        """The marks in the menus say what is chosen."""
        theme = self._window.theme
        self.actions.choose(f"theme.{theme.mode}")
        self.actions["theme.motion"].setChecked(theme.reduced_motion)
        self.actions["theme.contrast"].setChecked(theme.high_contrast)

    # -- over the window --------------------------------------------------------------------------

    def open_palette(self) -> None:
        """Open the command palette, or close it."""
        if self._palette is None:
            window = self._window
            self._palette = command_palette.Palette(
                window.theme, window, self._offers.all, self.do, self._rebind
            )
            kept: list[object] = self._session.settings.get("palette_last", [])
            self._palette.last = [id for id in kept if isinstance(id, str)]
            self._palette.on_last = lambda ids: window.state.keep("palette_last", list(ids))
        self._palette.open()

    def do(self, entry: Entry) -> None:
        """Do what an entry of the palette is about."""
        kind, name, window = entry.kind, entry.name, self._window
        if kind == "command":
            self.actions.run(name)
        elif kind == "panel":
            dock = window.open_panel(name)
            if dock is not None and window.bench is not None:
                window.bench.focus_panel(dock)
        elif kind == "topic":
            if window.bench is None:
                self.show_layout("developer")
            window.open_topic(name)
            self.mark_topic(name)
        elif kind == "robot":
            dock = window.open_panel("robots")
            if dock is not None and isinstance(dock.panel, ChoosesRobot):
                dock.panel.choose(name)
        elif kind == "layout":
            self._use_layout(name)
        elif kind in {"file", "example"}:
            (self._files.open if kind == "file" else self._files.example)(Path(name))

    def mark_topic(self, name: str) -> None:
        """Choose a topic that was opened by command in the list of topics too, where that is open."""
        bench = self._window.bench
        if bench is not None and "topics" in bench.open_names():
            bench.docks["topics"].panel.show_topic(name)

    def open_shortcuts(self) -> None:
        """Open the table of shortcuts."""
        self._sheet_of_shortcuts().open()

    def _sheet_of_shortcuts(self) -> shortcuts.ShortcutSheet:
        if self._shortcut_sheet is None:
            self._shortcut_sheet = shortcuts.ShortcutSheet(self._window.theme, self._window, self.shortcuts)
        return self._shortcut_sheet

    def _rebind(self, command: str) -> None:
        self._sheet_of_shortcuts().open_for(command)

    def open_settings(self) -> None:
        """Open the settings."""
        if self._settings_sheet is None:
            window = self._window
            self._settings_sheet = settings_sheet.SettingsSheet(
                window.theme, window, window.state, self._session.settings
            )
            self._settings_sheet.shortcuts.clicked.connect(self.open_shortcuts)
        self._settings_sheet.open()

    # -- layouts ----------------------------------------------------------------------------------

    def show_layout(self, layout: str) -> None:
        """Show Behaviour or Developer as it was left."""
        self._window.show_layout(layout)
        self.actions.choose(f"layout.{layout}")

    def _built_in(self, layout: str) -> None:
        """Show the built-in arrangement of a layout, also in place of an own one."""
        self._window.arrangements.use(self._window.show_layout(layout), layout, "")
        self.actions.choose(f"layout.{layout}")

    def _use_layout(self, name: str) -> None:
        own = self._window.arrangements.named(name)
        if own is not None:
            bench = self._window.show_layout(own.base)
            self._window.arrangements.use(bench, own.base, name)
            self.actions.choose(f"layout.{own.base}")

    def _reset(self) -> None:
        if self._window.bench is not None:
            self._window.bench.arrange()

    def _ask_name(self) -> name_sheet.NameSheet:
        if self._name_sheet is None:
            self._name_sheet = name_sheet.NameSheet(self._window.theme, self._window)
        return self._name_sheet

    def _keep_layout(self) -> None:
        arrangements, bench, base = self._window.arrangements, self._window.bench, self._window.showing
        if bench is None:
            return

        def keep(name: str) -> None:
            kept = arrangements.keep_as(bench, base, name)
            self._window.toast.say(f"Kept the layout “{name}”" if kept else f"“{name}” is there {UNTIL_END}")

        self._ask_name().ask(NEXT_LAYOUT, "Keep it", arrangements.refusal, keep)

    def _rename_layout(self) -> None:
        arrangements = self._window.arrangements
        old = arrangements.own(self._window.showing)
        if old:
            self._ask_name().ask(
                f"Another name for “{old}”",
                "Rename it",
                lambda name: arrangements.refusal(name, old),
                lambda name: arrangements.rename(old, name),
                old,
            )

    def _delete_layout(self) -> None:
        arrangements, window = self._window.arrangements, self._window
        name = arrangements.own(window.showing)
        if name:
            kept, undo = arrangements.delete(window.bench, name)
            words = f"Deleted the layout “{name}”" if kept else f"“{name}” is gone {UNTIL_END}"
            window.toast.say(words, "Undo", undo)

    def _freeze(self) -> None:
        freeze_or_go_on(self._window.bench)
        self.tools.refresh()

    # -- the look ---------------------------------------------------------------------------------

    def _theme(self, mode: Mode) -> None:
        self._window.theme.set_mode(mode)
        self._window.state.keep_theme(self._window.theme)

    def _motion(self) -> None:
        chosen: Wish = "on" if self.actions["theme.motion"].isChecked() else "off"
        self._window.theme.set_motion(chosen)
        self._window.state.keep_theme(self._window.theme)

    def _contrast(self) -> None:
        chosen: Wish = "on" if self.actions["theme.contrast"].isChecked() else "off"
        self._window.theme.set_contrast(chosen)
        self._window.state.keep_theme(self._window.theme)

    def _text(self, percent: int) -> None:
        self._window.theme.set_text_percent(percent)
        self._window.state.keep_theme(self._window.theme)

    # -- recent files -----------------------------------------------------------------------------

    def _forget_recent(self) -> None:
        settings = self._session.settings
        before: list[RecentFile] = settings.recent_known
        words = "Cleared the list of recent files"
        try:
            settings.set_recent([])
        except SettingsError as error:
            self._window.complain(str(error))
            words = f"The list of recent files is empty {UNTIL_END}"
        self._window.show_recent()
        self._window.toast.say(words, "Undo", lambda: self._remember(before))

    def _remember(self, files: list[RecentFile]) -> None:
        try:
            self._session.settings.set_recent(files)
        except SettingsError as error:
            self._window.complain(str(error))
        self._window.show_recent()
