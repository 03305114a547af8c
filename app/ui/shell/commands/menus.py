"""Menus whose entries depend on the state: recent files, panels and layouts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from PySide6.QtWidgets import QWidget

from app.core.projects.titles import recent_titles
from app.core.session import Session
from app.ui.panels.base import Panel, numbered_title
from app.ui.shell.actions.actions import Actions
from app.ui.shell.commands.shell import Shell
from app.ui.shell.commands.view import ViewCommands
from app.ui.shell.docking.dock import parse_key
from app.ui.shell.docking.layouts import LAYOUTS
from app.ui.text import plain
from app.ui.widgets.menus import Menu, open_below
from nep.i18n import _

LAYOUT_COMMANDS = ("layout.keep", "layout.rename", "layout.delete", "layout.export", "layout.open")


class DynamicMenus:
    """Controller that updates the dynamic menus, and disables unavailable entries, when a menu opens."""

    def __init__(
        self,
        shell: Shell,
        session: Session,
        actions: Actions,
        menus: Mapping[str, Menu],
        view: ViewCommands,
        open_file: Callable[[Path], object],
    ) -> None:
        self._shell, self._session, self.actions = shell, session, actions
        self._view, self._open_file = view, open_file
        theme, surface = shell.theme, shell.surface
        self._recent_menu = Menu(theme, surface, _("Recent"))
        menus["File"].insertMenu(actions["file.save"], self._recent_menu)
        self._panel_menu = Menu(theme, surface, _("Panels"))
        self._layout_submenu = menus["View/Layouts"]
        menus["View"].insertMenu(self._layout_submenu.menuAction(), self._panel_menu)
        for name, menu in menus.items():
            if "/" in name:
                continue
            menu.aboutToShow.connect(lambda name=name: self._refresh(name))
            menu.aboutToHide.connect(actions.enable_all)
        self._layout_menu = Menu(theme, surface, _("Layouts"))
        self._layout_menu.aboutToHide.connect(actions.enable_all)

    def open_layout_menu(self, anchor: QWidget) -> None:
        """Open a menu with the layouts and the commands for layouts below a button."""
        self.actions.disable_unavailable()
        self._list_layouts(self._layout_menu)
        self._layout_menu.addAction(self.actions["layout.reset"])
        open_below(self._layout_menu, anchor)

    def open_panel_menu(self, anchor: QWidget) -> None:
        """Open a menu with the panels below a button; open panels are checked."""
        self._list_panels()
        open_below(self._panel_menu, anchor)

    def _refresh(self, menu: str) -> None:
        self.actions.add_contributions()
        self.actions.disable_unavailable()
        if menu == "File":
            self._list_recent()
        elif menu == "View":
            self._list_panels()
            self._list_layouts(self._layout_submenu)

    def _list_recent(self) -> None:
        self._recent_menu.clear()
        recent_files = recent_titles(self._session.settings.all_recent_files)
        self._recent_menu.menuAction().setVisible(bool(recent_files))
        for file in recent_files:
            label = file.name
            if not file.exists:
                label = _("{file} (missing)").format(file=file.name)
            entry = self._recent_menu.addAction(plain.escape_menu_text(label))
            entry.setToolTip(plain.tip(str(file.path)))
            entry.setEnabled(file.exists)
            entry.triggered.connect(lambda _on=False, path=file.path: self._open_file(path))
        self._recent_menu.addSeparator()
        self._recent_menu.addAction(self.actions["file.forget_recent"])

    def _list_layouts(self, menu: Menu) -> None:
        menu.clear()
        arrangements, current = self._shell.saved_layouts, self._shell.current_layout
        for layout in LAYOUTS:
            entry = menu.addAction(self._shell.theme.icon(layout.icon), _(layout.title))
            entry.setCheckable(True)
            entry.setChecked(current == layout.name and not arrangements.custom_name(layout.name))
            entry.triggered.connect(lambda _on=False, name=layout.name: self._view.show_built_in_layout(name))
        custom_layouts = arrangements.all()
        if custom_layouts:
            menu.addSeparator()
        for custom in custom_layouts:
            entry = menu.addAction(plain.escape_menu_text(custom.name))
            entry.setCheckable(True)
            entry.setChecked(current == custom.base and arrangements.custom_name(custom.base) == custom.name)
            entry.triggered.connect(lambda _on=False, name=custom.name: self._view.show_custom_layout(name))
        menu.addSeparator()
        for name in LAYOUT_COMMANDS:
            menu.addAction(self.actions[name])

    def _list_panels(self) -> None:
        self._panel_menu.clear()
        shell = self._shell
        self._panel_menu.menuAction().setVisible(shell.bench is not None)
        if shell.bench is None:
            return
        self.actions.select(f"layout.{shell.current_layout}")
        open_keys = shell.bench.open_names()
        for panel in sorted(shell.panels.values(), key=lambda panel: _(panel.title)):
            if panel.name == "behaviour" and shell.current_layout != "behaviour":
                continue
            entry = self._panel_menu.addAction(shell.theme.icon(panel.icon), _(panel.title))
            entry.setCheckable(True)
            entry.setChecked(panel.name in open_keys)
            entry.triggered.connect(lambda on=False, name=panel.name: self._set_panel_open(name, on))
            for key in open_keys:
                name, number = parse_key(key)
                if name == panel.name and number > 1:
                    self._add_extra_panel(panel, key, number)

    def _add_extra_panel(self, panel: Panel, key: str, number: int) -> None:
        title = numbered_title(_(panel.title), number)
        entry = self._panel_menu.addAction(self._shell.theme.icon(panel.icon), title)
        entry.setCheckable(True)
        entry.setChecked(True)
        entry.triggered.connect(lambda on=False, key=key: self._set_panel_open(key, on))

    def _set_panel_open(self, name: str, is_open: bool) -> None:
        bench = self._shell.bench
        if bench is None:
            return
        if is_open:
            bench.open(name)
        else:
            bench.docks[name].close()
