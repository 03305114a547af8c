"""Sheet with the settings of Studio, made from their descriptions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from app.core.storage.setting import (
    ChoiceSetting,
    FlagSetting,
    FolderSetting,
    NumberSetting,
    Setting,
    SheetRow,
)
from app.core.storage.settings import Settings
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.window_state import WindowState
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ComboBox, ElidedLabel, Segments, Switch, label
from app.ui.widgets.file_dialogs import FileDialogs
from app.ui.widgets.inputs.fields import NumberEdit
from nep.i18n import _

WIDTH = 620
MAX_SEGMENTS = 3
"""Maximum number of options of a choice in a segmented control; for more, a combo box is used."""


@dataclass(frozen=True, slots=True)
class SettingControls:
    """Controls of a setting in the sheet.

    Attributes:
        control: Control with which the user changes the setting.
        content: Control, or layout of the control and other parts.
        show: Shows the current value.
        display: Label with the current value, or None if the control shows it.
        notice: Button or hint for a restart that a changed value needs, or None.
    """

    control: QWidget
    content: QWidget | QHBoxLayout
    show: Callable[[], object]
    display: QLabel | None = None
    notice: QWidget | None = None


class SettingsSheet(Overlay):
    """Sheet with all settings that have a row (`Setting.row`).

    Changes are applied and saved immediately, except for settings that take effect after a restart.
    """

    top = 72

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        state: WindowState,
        settings: Settings,
        dialogs: FileDialogs,
        *,
        notes: Mapping[Setting[Any], Callable[[], str]],
        editors: Mapping[Setting[Any], Callable[[], object]],
        restart: Callable[[], object] | None = None,
    ) -> None:
        # `notes` return the texts of settings that are changed elsewhere, `editors` open sheets of their own.
        # `restart` restarts Studio and reopens all documents; None if that is impossible.
        super().__init__(theme, window, _("Settings"))
        self._state, self._settings, self._dialogs = state, settings, dialogs
        self._notes, self._editors, self._restart = notes, editors, restart
        self.rows = {
            setting: self._create_controls(setting, setting.row)
            for setting in settings.described()
            if setting.row is not None
        }
        """Controls of each setting in the sheet, in order."""
        self._lay_out()
        for setting in self.rows:
            settings.on_change(setting, lambda _value: self._show())
        theme.changed.connect(self._show)

    def _create_controls(self, setting: Setting[Any], row: SheetRow) -> SettingControls:
        if setting in self._editors:
            controls = self._create_editor_button(row, self._editors[setting])
        elif setting in self._notes:
            controls = self._create_note(self._notes[setting])
        elif isinstance(setting, FlagSetting):
            controls = self._create_switch(setting, row)
        elif isinstance(setting, NumberSetting):
            controls = self._create_number(setting, row)
        elif isinstance(setting, ChoiceSetting):
            controls = self._create_choice(setting, row)
        elif isinstance(setting, FolderSetting):
            controls = self._create_folder_chooser(setting)
        else:
            raise TypeError(f"no control for the setting {setting.key!r}")
        if row.explanation:
            controls.control.setToolTip(plain.tip(_(row.explanation)))
            controls.control.setAccessibleDescription(_(row.explanation))
        return controls

    def _create_editor_button(self, row: SheetRow, open_editor: Callable[[], object]) -> SettingControls:
        button = Button(self.theme, _(row.label), row.icon, size="form")
        button.clicked.connect(open_editor)
        return SettingControls(button, button, lambda: None)

    def _create_note(self, text: Callable[[], str]) -> SettingControls:
        note = label("", "body", role="textSecondary", wrap=True)
        content = QHBoxLayout()
        content.addWidget(note, 1)
        return SettingControls(note, content, lambda: note.setText(text()), note)

    def _create_switch(self, setting: FlagSetting, row: SheetRow) -> SettingControls:
        switch = Switch(self.theme, _(row.label))
        switch.clicked.connect(lambda is_on: self._state.save(setting, is_on))
        return SettingControls(switch, switch, lambda: switch.setChecked(self._settings.value(setting)))

    def _create_number(self, setting: NumberSetting, row: SheetRow) -> SettingControls:
        if setting.choices:
            options = [(str(each), f"{each} {setting.unit}".rstrip(), None) for each in setting.choices]
            segments = self._create_segments(options, row)
            segments.changed.connect(lambda number: self._state.save(setting, int(number)))
            return SettingControls(
                segments, segments, lambda: segments.set_value(str(self._settings.value(setting)))
            )
        field = NumberEdit(self.theme, setting.minimum, setting.maximum, setting.unit)
        field.setAccessibleName(_(row.title))
        field.number_entered.connect(lambda number: self._state.save(setting, round(number)))
        return SettingControls(field, field, lambda: field.show_number(self._settings.value(setting)))

    def _create_choice(self, setting: ChoiceSetting[Any], row: SheetRow) -> SettingControls:
        options = [(option.value, option.label, option.icon) for option in setting.options()]
        control: Segments | ComboBox
        if len(options) > MAX_SEGMENTS:
            box = control = ComboBox(
                self.theme, [(value, text) for value, text, _icon in options], name=_(row.title)
            )
            box.activated.connect(lambda _index: self._state.save(setting, box.value))
        else:
            control = self._create_segments(options, row)
            control.changed.connect(lambda value: self._state.save(setting, value))
        if setting.active is None:
            return SettingControls(control, control, lambda: control.set_value(self._settings.value(setting)))
        return self._add_restart(setting, setting.active, control)

    def _add_restart(
        self, setting: ChoiceSetting[Any], active: Callable[[], str], control: Segments | ComboBox
    ) -> SettingControls:
        # Beside the control: the button or hint that a changed value needs a restart.
        notice: QWidget
        if self._restart is not None:
            notice = Button(self.theme, _("Restart now"), "rotate-ccw", size="form")
            notice.clicked.connect(self._restart)
        else:
            notice = label(_("Applies after restarting Studio"), "body", role="textSecondary")
        content = QHBoxLayout()
        content.addWidget(control)
        content.addWidget(notice)
        content.addStretch(1)

        def show() -> None:
            selected = self._settings.value(setting)
            if all(option.value != selected for option in setting.options()):
                selected = active()
            control.set_value(selected)
            notice.setVisible(selected != active())

        return SettingControls(control, content, show, notice=notice)

    def _create_segments(self, options: Sequence[tuple[str, str, str | None]], row: SheetRow) -> Segments:
        return Segments(self.theme, options, check=True, size="form", name=_(row.title))

    def _create_folder_chooser(self, setting: FolderSetting) -> SettingControls:
        display = ElidedLabel("bodyLarge", "textSecondary")
        button = Button(self.theme, _("Choose a folder"), "folder-open", size="form")

        def save(folder: Path) -> None:
            self._state.save(setting, folder)

        button.clicked.connect(lambda: self._dialogs.select_folder(str(self._settings.value(setting)), save))
        content = QHBoxLayout()
        content.addWidget(display, 1)
        content.addWidget(button)
        return SettingControls(
            button, content, lambda: display.setText(str(self._settings.value(setting))), display
        )

    def _lay_out(self) -> None:
        header = self.create_header(label(_("Settings"), "heading"))
        header.setContentsMargins(19, 0, 19, 0)
        self._content = QWidget()
        self._content.setProperty("bare", "true")
        self._fill(QGridLayout(self._content))
        self._area = QScrollArea()
        self._area.setWidgetResizable(True)
        self._area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._area.viewport().setAutoFillBackground(False)
        self._area.setWidget(self._content)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 14, 1, 16)
        column.setSpacing(12)
        column.addLayout(header)
        column.addWidget(self._area, 1)

    def _fill(self, grid: QGridLayout) -> None:
        grid.setContentsMargins(19, 4, 19, 4)
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(12)
        grid.setColumnStretch(1, 1)
        for index, (setting, controls) in enumerate(self.rows.items()):
            title = _(setting.row.title) if setting.row is not None else ""
            caption = label(title, "bodyLarge", role="textSecondary")
            grid.addWidget(caption, index, 0, Qt.AlignmentFlag.AlignVCenter)
            content = controls.content
            if isinstance(content, QWidget):
                alignment = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
                grid.addWidget(content, index, 1, alignment)
            else:
                grid.addLayout(content, index, 1)

    def initial_focus(self) -> QWidget:
        first = next(iter(self.rows.values())).control
        return (first.selected_button() or self) if isinstance(first, Segments) else first

    def preferred_size(self, room: QSize) -> QSize:
        content_size = self._content.sizeHint()
        width = max(round(self.theme.scaled(WIDTH)), content_size.width() + 14)
        height = content_size.height() + self.sizeHint().height() - self._area.sizeHint().height() + 4
        return QSize(min(room.width(), width), min(room.height(), height))

    def open(self) -> None:
        """Update the sheet to the current settings and open it."""
        self._show()
        super().open()

    def _show(self) -> None:
        for controls in self.rows.values():
            controls.show()
        if self.isVisible():
            self.place()
