"""Commands for the window: palette, sheets, layouts, theme, text size and help.

Sheets are created on first use, so that they don't delay the startup.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QUrl
from PySide6.QtGui import QAction

from app import resources
from app.core.faults import log_folder
from app.core.recording.topic_choice import file_stem
from app.core.session import Session
from app.core.storage.atomic_file import read_regular_file, write_atomically
from app.core.storage.settings import Mode, Preference, Settings
from app.ui.intents import ShowRobot
from app.ui.other_programs import open_externally
from app.ui.shell.actions.actions import Actions
from app.ui.shell.actions.shortcuts import Shortcuts
from app.ui.shell.commands.freeze import toggle_freeze
from app.ui.shell.commands.palette_entries import PaletteEntries
from app.ui.shell.commands.shell import START_PAGE, Shell
from app.ui.shell.dialogs.about import AboutSheet
from app.ui.shell.docking.layout_file import MAX_BYTES, LayoutFileError, decode_layout, encode_layout
from app.ui.shell.docking.layouts import layout_named
from app.ui.shell.hint_ring import HintRing
from app.ui.shell.projects import ProjectController
from app.ui.speaker import has_voice_engine, voice_text
from app.ui.widgets.file_dialogs import LAYOUT_FILTER, FileKind
from app.ui.widgets.lists.fuzzy import Entry
from nep.i18n import _, format_list, language
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui.shell.dialogs import command_palette, guide, shortcuts
    from app.ui.shell.dialogs import name as name_sheet
    from app.ui.shell.dialogs import settings as settings_sheet
else:
    guide = lazy_module("app.ui.shell.dialogs.guide")
    command_palette, name_sheet = (
        lazy_module("app.ui.shell.dialogs.command_palette"),
        lazy_module("app.ui.shell.dialogs.name"),
    )
    settings_sheet, shortcuts = (
        lazy_module("app.ui.shell.dialogs.settings"),
        lazy_module("app.ui.shell.dialogs.shortcuts"),
    )

TEXT_SIZE_STEP_PERCENT = 25
MAX_LISTED_PANELS = 4


class ViewCommands:
    """Handlers of the commands for layouts, sheets and the theme; call `set_actions` before any of them."""

    def __init__(self, shell: Shell, session: Session, files: ProjectController, keys: Shortcuts) -> None:
        self._shell, self._session, self._files = shell, session, files
        self.shortcuts = keys
        self._palette: command_palette.CommandPalette | None = None
        self._shortcut_sheet: shortcuts.ShortcutSheet | None = None
        self._name_sheet: name_sheet.NameSheet | None = None
        self._settings_sheet: settings_sheet.SettingsSheet | None = None
        self._hint_ring: HintRing | None = None
        self._guide_sheet: guide.GuideSheet | None = None

    def set_actions(self, actions: Actions, entries: PaletteEntries) -> None:
        """Connect the actions and the command palette.

        The shortcuts and check marks of the actions are updated from now on.
        """
        self._actions, self._entries = actions, entries
        self.shortcuts.changed.connect(self.update_shortcuts)
        self._shell.theme.changed.connect(self._update_theme_actions)
        self.update_shortcuts()
        self._update_theme_actions()

    def update_shortcuts(self) -> None:
        """Update the shortcuts of all actions; some work only in one layout."""
        layout = self._shell.current_layout if self._shell.bench is not None else ""
        commands, keys_of = self.shortcuts.commands, self.shortcuts.shortcuts_of
        self._actions.set_shortcuts(
            lambda name: keys_of(name) if commands[name].keys_layout in {"", layout} else ()
        )

    def run_shortcut(self, key: str) -> bool:
        """Run the command to which a shortcut is assigned; return False if none is available."""
        self._actions.add_contributions()
        command = self.shortcuts.command_for(key)
        return bool(command) and self._actions.run(command)

    def open_palette(self) -> None:
        """Open the command palette, or close it if it is open."""
        if self._palette is None:
            shell = self._shell
            self._palette = command_palette.CommandPalette(
                shell.theme, shell.surface, self._entries.all, self.run_entry, self._rebind
            )
            self._palette.last_used_ids = list(self._session.settings.palette_entries)
            self._palette.on_last_used_changed = lambda ids: shell.state.save(
                Settings.palette_entries, tuple(ids)
            )
        self._palette.open()

    def run_entry(self, entry: Entry) -> None:
        """Run the command of a palette entry, or show the object that the entry stands for."""
        kind, name, shell = entry.kind, entry.name, self._shell
        if kind == "command":
            self._actions.run(name)
        elif kind in {"panel", "another"}:
            self._open_panel(name, is_additional=kind == "another")
        elif kind == "topic":
            if shell.bench is None:
                self.show_layout("developer")
            shell.open_topic(name)
            self._select_topic(name)
        elif kind == "robot":
            shell.request(ShowRobot(name))
        elif kind == "layout":
            self.show_custom_layout(name)
        elif kind in {"file", "example"}:
            (self._files.open if kind == "file" else self._files.open_example)(Path(name))

    def _open_panel(self, name: str, *, is_additional: bool) -> None:
        bench = self._shell.bench
        dock = (
            bench.open_another(name) if is_additional and bench is not None else self._shell.open_panel(name)
        )
        if dock is not None and self._shell.bench is not None:
            self._shell.bench.focus_panel(dock)

    def inspect(self, topic: str) -> None:
        """Show a topic in the Inspector of the Developer layout."""
        self.show_layout("developer")
        bench = self._shell.bench
        dock = bench.open_latest("inspector") if bench is not None else None
        if dock is not None:
            dock.panel.show_topic(topic)
            self._select_topic(topic)

    def _select_topic(self, name: str) -> None:
        # If the topics panel is open, the topic is selected there too.
        bench = self._shell.bench
        if bench is not None and "topics" in bench.open_names():
            bench.docks["topics"].panel.show_topic(name)

    def open_shortcuts(self) -> None:
        """Open the sheet of shortcuts."""
        self._get_shortcut_sheet().open()

    def _get_shortcut_sheet(self) -> shortcuts.ShortcutSheet:
        if self._shortcut_sheet is None:
            shell = self._shell
            self._actions.add_contributions()
            self._shortcut_sheet = shortcuts.ShortcutSheet(shell.theme, shell.surface, self.shortcuts)
        return self._shortcut_sheet

    def _rebind(self, command: str) -> None:
        self._get_shortcut_sheet().open_for(command)

    def open_settings(self) -> None:
        """Open the sheet with the settings."""
        if self._settings_sheet is None:
            shell = self._shell
            self._settings_sheet = settings_sheet.SettingsSheet(
                shell.theme,
                shell.surface,
                shell.state,
                self._session.settings,
                self._files.dialogs,
                notes={Settings.is_robot_sound_on: self._voice_text},
                editors={Settings.shortcuts: self.open_shortcuts},
                restart=self._restart if shell.can_restart else None,
            )
        self._settings_sheet.open()

    def _restart(self) -> None:
        reason = self._shell.restart()
        if reason:
            self._shell.show_toast(reason)

    def _voice_text(self) -> str:
        # Includes whether speech actually works: an engine can be installed without a voice.
        return voice_text(self._session.voices.problem, has_engine=has_voice_engine())

    def show_start_page(self) -> None:
        """Show the start page, and save that it is shown at the next start too."""
        self._shell.show_start()
        self._shell.state.save_layout(START_PAGE)

    def exit_start_page(self) -> None:
        """Leave the start page and show the previous layout."""
        if self._shell.current_layout == START_PAGE and self._shell.return_layout:
            self.show_layout(self._shell.return_layout)

    def show_layout(self, layout: str) -> None:
        """Show the layout "behaviour" or "developer" with its last arrangement."""
        self._shell.show_layout(layout)
        self._actions.select(f"layout.{layout}")

    def show_built_in_layout(self, layout: str) -> None:
        """Show a layout with its built-in arrangement instead of a custom layout."""
        self._shell.saved_layouts.switch(self._shell.show_layout(layout), layout, "")
        self._actions.select(f"layout.{layout}")

    def show_custom_layout(self, name: str) -> None:
        """Show the custom layout with this name, if it exists."""
        custom_layout = self._shell.saved_layouts.named(name)
        if custom_layout is not None:
            bench = self._shell.show_layout(custom_layout.base)
            self._shell.saved_layouts.switch(bench, custom_layout.base, name)
            self._actions.select(f"layout.{custom_layout.base}")

    def reset_layout(self) -> None:
        """Restore the default arrangement of the panels in the current layout."""
        if self._shell.bench is not None:
            self._shell.bench.reset_layout()

    @property
    def name_sheet(self) -> name_sheet.NameSheet:
        """Sheet that asks for a name, created on first use."""
        if self._name_sheet is None:
            self._name_sheet = name_sheet.NameSheet(self._shell.theme, self._shell.surface)
        return self._name_sheet

    def save_layout(self) -> None:
        """Ask for a name and save the current arrangement as a custom layout."""
        shell = self._shell
        arrangements, bench, base = shell.saved_layouts, shell.bench, shell.current_layout
        if bench is None:
            return

        def save(name: str) -> None:
            is_saved = arrangements.save_as(bench, base, name)
            message = (
                _("Saved layout “{name}”")
                if is_saved
                else _("Can't save layout “{name}”. It will be lost when Studio closes.")
            )
            shell.show_toast(message.format(name=name))

        self.name_sheet.ask(_("Save layout as"), _("Save"), arrangements.rejection_reason, save)

    def rename_layout(self) -> None:
        """Ask for a new name and rename the current custom layout."""
        arrangements = self._shell.saved_layouts
        old_name = arrangements.custom_name(self._shell.current_layout)
        if old_name:
            self.name_sheet.ask(
                _("New name for “{name}”").format(name=old_name),
                _("Rename"),
                lambda name: arrangements.rejection_reason(name, old_name),
                lambda name: arrangements.rename(old_name, name),
                old_name,
            )

    def delete_layout(self) -> None:
        """Delete the current custom layout and show a toast with an Undo button."""
        arrangements, shell = self._shell.saved_layouts, self._shell
        name = arrangements.custom_name(shell.current_layout)
        if name:
            is_saved, undo = arrangements.delete(shell.bench, name)
            message = (
                _("Deleted the layout “{name}”")
                if is_saved
                else _("This change couldn't be saved. “{name}” will reappear when Studio restarts.")
            )
            shell.show_toast(message.format(name=name), _("Undo"), undo)

    def export_layout(self) -> None:
        """Ask for a file and export the current layout to it."""
        shell = self._shell
        bench, base = shell.bench, shell.current_layout
        if bench is None:
            return
        name = shell.saved_layouts.custom_name(base) or _(layout_named(base).title)

        def save(path: Path, _kind: FileKind) -> None:
            try:
                write_atomically(path, encode_layout(name, base, bench.save()))
            except OSError as error:
                reason = (error.strerror or str(error)).lower()
                message = _("can't write {file}: {reason}").format(file=path.name, reason=reason)
                shell.show_toast(f"{message[:1].upper()}{message[1:]}")
            else:
                shell.show_toast(_("Saved the layout to {file}").format(file=path.name))

        kind = FileKind(LAYOUT_FILTER[0], LAYOUT_FILTER[1].lstrip("*"))
        suggestion = Path.home() / f"{file_stem(name)}{kind.suffix}"
        self._files.dialogs.save_as(_("Save layout to a file"), suggestion, [kind], save)

    def ask_layout(self) -> None:
        """Ask for a layout file and import it."""
        self._files.dialogs.open_layout(str(Path.home()), self.import_layout)

    def import_layout(self, path: Path) -> None:
        """Import a layout file and show the layout; an error is shown in a toast."""
        shell = self._shell
        try:
            imported_layout = decode_layout(read_regular_file(path, MAX_BYTES), path.stem, shell.panels)
        except (OSError, LayoutFileError) as error:
            reason = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
            reason = f"{reason[:1].lower()}{reason[1:]}"
            shell.show_toast(_("Can't open {file}: {reason}").format(file=path.name, reason=reason))
            return
        layouts, previous_name = shell.saved_layouts, shell.saved_layouts.custom_name(imported_layout.base)
        if not layouts.can_restore(
            shell.show_layout(imported_layout.base), imported_layout.base, imported_layout.saved
        ):
            shell.show_toast(
                _("Can't open {file}: {reason}").format(file=path.name, reason=_("the file is damaged"))
            )
            return
        name, _is_saved = layouts.import_layout(
            imported_layout.name, imported_layout.base, imported_layout.saved
        )
        self.show_custom_layout(name)

        def undo() -> None:
            bench = shell.bench if shell.current_layout == imported_layout.base else None
            layouts.delete(bench, name)
            if previous_name and bench is not None:
                layouts.switch(bench, imported_layout.base, previous_name)

        message = _("Opened the layout “{name}”").format(name=name)
        if imported_layout.unknown_panels:
            unknown_panels = format_list(list(imported_layout.unknown_panels[:MAX_LISTED_PANELS]))
            message = _("{opened}. Unknown panels were skipped: {panels}").format(
                opened=message, panels=unknown_panels
            )
        shell.show_toast(message, _("Undo"), undo)

    def toggle_frozen_panels(self) -> None:
        """Freeze all panels, or unfreeze them if all are frozen."""
        toggle_freeze(self._shell.bench)

    def _update_theme_actions(self) -> None:
        theme = self._shell.theme
        self._actions.select(f"theme.{theme.mode}")
        self._actions["theme.motion"].setChecked(theme.is_motion_reduced)
        self._actions["theme.contrast"].setChecked(theme.is_high_contrast)

    def set_theme(self, mode: Mode) -> None:
        """Set and save the theme mode: "light", "dark" or "system"."""
        self._shell.state.save(Settings.theme, mode)

    def update_motion(self) -> None:
        """Set and save reduced motion according to the check mark of its action."""
        self._shell.state.save(Settings.motion, _preference(self._actions["theme.motion"]))

    def update_contrast(self) -> None:
        """Set and save high contrast according to the check mark of its action."""
        self._shell.state.save(Settings.contrast, _preference(self._actions["theme.contrast"]))

    def set_text_size(self, percent: int) -> None:
        """Set and save the text size in percent."""
        self._shell.state.save(Settings.text_percent, percent)

    def show_first_steps(self) -> None:
        """Show the panel with the first steps next to the blocks."""
        self.show_layout("behaviour")
        self._shell.open_panel("behaviour")
        self._shell.panel_focus.focus(self._shell.open_panel("first_steps"))

    def open_guide(self) -> None:
        """Open the guide at the last selected entry of its list."""
        if self._guide_sheet is None:
            shell = self._shell
            self._guide_sheet = guide.GuideSheet(shell.theme, shell.surface, self._guide_pages)
        self._guide_sheet.open()

    def _guide_pages(self) -> Sequence[guide.GuidePage]:
        self._actions.add_contributions()
        return guide.read_pages(resources.folder() / "guide", language(), self.shortcuts.first_shortcut)

    def show_examples(self) -> None:
        """Show all examples on the start page."""
        self.show_start_page()
        self._shell.show_examples()

    def point_at(self, command: str) -> bool:
        """Highlight the button of a command; return False if no such button is visible."""
        if self._hint_ring is None:
            self._hint_ring = HintRing(self._shell.theme, self._shell.surface)
        return self._hint_ring.point_at(command)

    def open_log_folder(self) -> None:
        """Open the folder of log files, creating it if necessary."""
        folder = log_folder()
        try:
            folder.mkdir(0o700, parents=True, exist_ok=True)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            self._shell.show_toast(_("Can't create {folder}: {reason}").format(folder=folder, reason=reason))
            return
        if not open_externally(QUrl.fromLocalFile(str(folder))):
            self._shell.show_toast(_("The log files are in {folder}").format(folder=folder))

    def open_about(self) -> None:
        """Open the About sheet."""
        AboutSheet(self._shell.theme, self._shell.surface, self._shell.show_toast).open()


def _preference(action: QAction) -> Preference:
    return "on" if action.isChecked() else "off"
