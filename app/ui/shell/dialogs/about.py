"""About sheet: versions, licences and system information, which can be copied."""

from __future__ import annotations

import platform
from collections.abc import Callable

from PySide6.QtCore import QSize, Qt, qVersion
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QGridLayout, QHBoxLayout, QVBoxLayout, QWidget

from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, IconButton, label
from nep.i18n import _, lazy
from nep.version import __version__

TITLE = "NEP Studio"
TEXT_LINES = (
    lazy("See what robots send, and program what they do."),
    lazy("NEP Studio is free software (MIT licence)."),
    lazy("Inter, JetBrains Mono and M PLUS 1p: SIL Open Font License 1.1. Icons: Lucide, ISC licence."),
)
WIDTH = 460


def versions() -> tuple[tuple[str, str], ...]:
    """Return pairs of name and version for Studio, its libraries and the system."""
    return (
        ("NEP Studio", __version__),
        ("nep", __version__),
        ("Python", platform.python_version()),
        ("Qt", qVersion() or ""),
        (_("System"), f"{platform.system()} {platform.release()} ({platform.machine()})"),
    )


class AboutSheet(Overlay):
    """Sheet with versions and licences, which is deleted when it is closed."""

    top = 96

    def __init__(self, theme: Theme, window: QWidget, notify: Callable[[str], object]) -> None:
        # `notify` confirms that the versions were copied.
        super().__init__(theme, window, TITLE)
        self._notify = notify
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 16, 20, 18)
        column.setSpacing(12)
        header = QHBoxLayout()
        header.addWidget(label(TITLE, "heading", wrap=True), 1)
        self._close_button = IconButton(theme, "x", _("Close"), "Esc")
        self._close_button.clicked.connect(self.dismiss)
        header.addWidget(self._close_button)
        column.addLayout(header)
        lines = QVBoxLayout()
        lines.setSpacing(6)
        for text in TEXT_LINES:
            lines.addWidget(label(_(text), "body", role="textSecondary", wrap=True))
        column.addLayout(lines)
        grid = QGridLayout()
        grid.setHorizontalSpacing(16)
        grid.setVerticalSpacing(4)
        grid.setColumnStretch(1, 1)
        for row, (name, version) in enumerate(versions()):
            grid.addWidget(label(name, "body", role="textSecondary"), row, 0, Qt.AlignmentFlag.AlignTop)
            version_label = label(version, "body", wrap=True)
            version_label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            grid.addWidget(version_label, row, 1)
        column.addLayout(grid)
        self.copy = Button(theme, _("Copy version information"), "copy", size="form")
        self.copy.clicked.connect(self._copy)
        footer = QHBoxLayout()
        footer.addWidget(self.copy)
        footer.addStretch(1)
        column.addLayout(footer)
        self.closed.connect(self.deleteLater)
        self.closed.connect(self._scrim.deleteLater)

    def _copy(self) -> None:
        text = "\n".join(f"{name}: {version}" for name, version in versions())
        QGuiApplication.clipboard().setText(text)
        self._notify(_("Copied version information"))

    def initial_focus(self) -> QWidget:
        return self._close_button

    def preferred_size(self, room: QSize) -> QSize:
        width = min(room.width(), round(self.theme.scaled(WIDTH)))
        layout = self.layout()
        height = layout.totalHeightForWidth(width) if layout is not None else 0
        return QSize(width, min(room.height(), height))
