"""Sheet with the settings of Studio."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QScrollArea, QVBoxLayout, QWidget

from app.core.messages import snapshots
from app.core.robots.last_robots import RESTART_SETTING
from app.core.storage.settings import Settings
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.shell.window_state import WindowState
from app.ui.theme.system import PREFERENCES
from app.ui.theme.theme import MODES, Theme
from app.ui.widgets import Button, ComboBox, ElidedLabel, Segments, Switch, label
from app.ui.widgets.file_dialogs import FileDialogs
from nep import i18n
from nep.i18n import _, lazy, pgettext

WIDTH = 620
MODE_LABELS = {
    "light": (lazy("Light"), "sun"),
    "dark": (lazy("Dark"), "moon"),
    "system": (lazy("Match system"), "monitor"),
}
PREFERENCE_LABELS = {"system": lazy("Match system"), "on": lazy("On"), "off": lazy("Off")}
TEXT_SIZES = ("100", "125", "150", "175", "200")
MAX_SEGMENTS = 3
"""Maximum number of languages in a segmented control; for more, a combo box is used."""


class SettingsSheet(Overlay):
    """Sheet with the settings of Studio.

    Changes are applied and saved immediately, except for the language, which requires a restart.
    """

    top = 72

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        state: WindowState,
        settings: Settings,
        dialogs: FileDialogs,
        get_voice_text: Callable[[], str],
        *,
        restart: Callable[[], object] | None = None,
    ) -> None:
        # `get_voice_text` describes the speech output and is called whenever the sheet opens. `restart`
        # restarts Studio and reopens all documents; None if that is impossible.
        super().__init__(theme, window, _("Settings"))
        self._state, self._settings, self._dialogs = state, settings, dialogs
        self._get_voice_text = get_voice_text
        self.language = self._language_input()
        self.restart_hint = label(_("Applies after restarting Studio"), "body", role="textSecondary")
        self.restart = Button(theme, _("Restart now"), "rotate-ccw", size="form")
        self._can_restart = restart is not None
        if restart is not None:
            self.restart.clicked.connect(restart)
        modes = [(mode, _(MODE_LABELS[mode][0]), MODE_LABELS[mode][1]) for mode in MODES]
        mode_name = pgettext("colours of the window", "Appearance")
        self.mode = Segments(theme, modes, check=True, size="form", name=mode_name)
        self.text = Segments(
            theme, [(p, f"{p} %", None) for p in TEXT_SIZES], check=True, size="form", name=_("Text size")
        )
        preferences = [(preference, _(PREFERENCE_LABELS[preference]), None) for preference in PREFERENCES]
        self.contrast = Segments(theme, preferences, check=True, size="form", name=_("High contrast"))
        self.motion = Segments(theme, preferences, check=True, size="form", name=_("Reduce motion"))
        self.robots = Switch(theme, _("Reopen at startup"))
        self.voice = label("", "body", role="textSecondary", wrap=True)
        self.shortcuts = Button(theme, _("Change shortcuts"), "keyboard", size="form")
        self.folder = ElidedLabel("bodyLarge", "textSecondary")
        self.choose = Button(theme, _("Choose a folder"), "folder-open", size="form")
        self.mode.changed.connect(self._set_mode)
        self.text.changed.connect(lambda percent: self._apply(lambda: theme.set_text_percent(int(percent))))
        self.contrast.changed.connect(self._set_contrast)
        self.motion.changed.connect(self._set_motion)
        self.robots.clicked.connect(lambda on: state.save(RESTART_SETTING, on))
        self.choose.clicked.connect(self._ask_folder)
        self._lay_out()
        theme.changed.connect(self._show)

    def _language_input(self) -> Segments | ComboBox:
        offered = i18n.selectable_languages()
        if len(offered) > MAX_SEGMENTS:
            choice = ComboBox(self.theme, offered, name=_("Language"))
            choice.activated.connect(lambda _index: self._set_language(choice.value))
            return choice
        segments = Segments(
            self.theme, [(code, name, None) for code, name in offered],
            check=True, size="form", name=_("Language"),
        )  # fmt: skip
        segments.changed.connect(self._set_language)
        return segments

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
        folder_row = QHBoxLayout()
        folder_row.addWidget(self.folder, 1)
        folder_row.addWidget(self.choose)
        language_row = QHBoxLayout()
        language_row.addWidget(self.language)
        language_row.addWidget(self.restart_hint)
        language_row.addWidget(self.restart)
        language_row.addStretch(1)
        voice_row = QHBoxLayout()
        voice_row.addWidget(self.voice, 1)
        rows: tuple[tuple[str, QWidget | QHBoxLayout], ...] = (
            (_("Language"), language_row),
            (pgettext("colours of the window", "Appearance"), self.mode),
            (_("Text size"), self.text),
            (_("High contrast"), self.contrast),
            (_("Reduce motion"), self.motion),
            (_("Virtual robots"), self.robots),
            (_("Robot voice"), voice_row),
            (_("Keyboard"), self.shortcuts),
            (_("Images"), folder_row),
        )
        for row, (text, control) in enumerate(rows):
            caption = label(text, "bodyLarge", role="textSecondary")
            grid.addWidget(caption, row, 0, Qt.AlignmentFlag.AlignVCenter)
            if isinstance(control, QWidget):
                grid.addWidget(control, row, 1, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter)
            else:
                grid.addLayout(control, row, 1)

    def initial_focus(self) -> QWidget:
        if isinstance(self.language, ComboBox):
            return self.language
        return self.language.selected_button() or self

    def preferred_size(self, room: QSize) -> QSize:
        content_size = self._content.sizeHint()
        width = max(round(self.theme.scaled(WIDTH)), content_size.width() + 14)
        height = content_size.height() + self.sizeHint().height() - self._area.sizeHint().height() + 4
        return QSize(min(room.width(), width), min(room.height(), height))

    def open(self) -> None:
        """Update the sheet to the current settings and open it."""
        self.voice.setText(self._get_voice_text())
        self._show()
        super().open()

    def _show(self) -> None:
        theme = self.theme
        language = self._selected_language()
        self.language.set_value(language)
        is_changed = language != i18n.language()
        self.restart_hint.setVisible(is_changed and not self._can_restart)
        self.restart.setVisible(is_changed and self._can_restart)
        self.mode.set_value(theme.mode)
        self.text.set_value(str(theme.text_percent))
        self.contrast.set_value(theme.contrast)
        self.motion.set_value(theme.motion)
        self.robots.setChecked(self._settings.get(RESTART_SETTING, True))
        self.folder.setText(str(snapshots.folder(self._settings)))
        if self.isVisible():
            self.place()

    def _apply(self, change: Callable[[], object]) -> None:
        change()
        self._state.save_theme(self.theme)

    def _selected_language(self) -> str:
        # The language that was chosen here if it is available, else the current one.
        language = self._settings.get("language", "")
        return language if language in dict(i18n.selectable_languages()) else i18n.language()

    def _set_language(self, language: str) -> None:
        self._state.save("language", language)
        self._show()

    def _set_mode(self, selected: str) -> None:
        mode = next(mode for mode in MODES if mode == selected)
        self._apply(lambda: self.theme.set_mode(mode))

    def _set_contrast(self, selected: str) -> None:
        preference = next(preference for preference in PREFERENCES if preference == selected)
        self._apply(lambda: self.theme.set_contrast(preference))

    def _set_motion(self, selected: str) -> None:
        preference = next(preference for preference in PREFERENCES if preference == selected)
        self._apply(lambda: self.theme.set_motion(preference))

    def _ask_folder(self) -> None:
        before = str(snapshots.folder(self._settings))
        self._dialogs.select_folder(before, self.save_folder)

    def save_folder(self, folder: Path) -> None:
        """Set and save the folder for images."""
        self._state.save(snapshots.FOLDER_SETTING, str(folder))
        self._show()
