"""Sheet "Report a problem": preview of the report file, omitted parts, and a description field.

Nothing is uploaded.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QSize, QStandardPaths, Qt, QTimer, QUrl
from PySide6.QtWidgets import QHBoxLayout, QLabel, QScrollArea, QVBoxLayout, QWidget

from app.core.reports.privacy import without_home
from app.core.reports.problem_report import (
    FILE_SUFFIX,
    ReportedWork,
    ReportParts,
    ReportWriter,
    create_report,
    describe_contents,
    file_name,
    work_text,
)
from app.ui.other_programs import open_externally
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, Switch, label, paint, set_role
from app.ui.widgets.file_dialogs import FileDialogs, FileKind
from app.ui.widgets.inputs.fields import LongTextField
from app.ui.widgets.labels import IconLabel
from nep.i18n import _, lazy

WIDTH, SIDE_MARGIN, SCROLL_BAR_WIDTH = 620, 19, 10
POLL_MS = 50
ICON_SIZE = 15
ZIP_KIND = FileKind(lazy("Zip file"), FILE_SUFFIX)
INTRODUCTION = lazy(
    "Studio writes a file that describes its state on this computer. Nothing is sent: you "
    "decide who gets the file."
)
NO_BEHAVIOURS = lazy("Your behaviours")
NO_BEHAVIOURS_UNLESS = lazy("Your behaviours, unless you include them below")
EXCLUDED_PARTS = (
    NO_BEHAVIOURS,
    lazy("Images, sounds and robot messages"),
    lazy("Keys, passwords and access codes. Your home folder appears as ~"),
)

ReportedWorkGetter = Callable[[], Sequence[ReportedWork]]


def documents_folder() -> Path:
    """Return the system's documents folder, or the home folder if there is none."""
    folder = QStandardPaths.writableLocation(QStandardPaths.StandardLocation.DocumentsLocation)
    return Path(folder) if folder and Path(folder).is_dir() else Path.home()


class ReportSheet(Overlay):
    """Sheet to write a report file, opened by a command or from the banner after a crash.

    The typed description is preserved until the report is written, even if the sheet is closed.
    """

    top = 72

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        dialogs: FileDialogs,
        notify: Callable[[str], object],
        clock: Callable[[], float],
    ) -> None:
        # `notify` announces a finished report if the sheet is closed; `clock` returns seconds since 1970.
        super().__init__(theme, window, _("Report a problem"))
        self._dialogs, self._notify, self._clock = dialogs, notify, clock
        self._parts: ReportParts | None = None
        self._behaviours: ReportedWorkGetter = tuple
        self._writer: ReportWriter | None = None
        self.written_path: Path | None = None
        """Path of the last report, or None."""
        self.introduction = label(_(INTRODUCTION), "body", role="textSecondary", wrap=True)
        self.description = LongTextField(theme, _("What happened?"))
        self.list = QVBoxLayout()
        self.list.setSpacing(4)
        self.work = Switch(theme, _("Include my open behaviours"))
        self.names = label("", "small", role="textSecondary", wrap=True)
        self.state = label("", "body", role="textSecondary", wrap=True)
        self.state.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.show_file = Button(theme, _("Show the file"), "folder-open", kind="primary", size="form")
        self.write = Button(theme, _("Write report"), "file-archive", kind="primary", size="form")
        self._poll_timer = QTimer(self)
        self._poll_timer.setInterval(POLL_MS)
        self._poll_timer.timeout.connect(self._check_writer)
        self.write.clicked.connect(self._ask_path)
        self.show_file.clicked.connect(self._show_file)
        self._lay_out()

    def _lay_out(self) -> None:
        self._header = self.create_header(label(_("Report a problem"), "heading"))
        self._header.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        self._content = QWidget()
        self._content.setProperty("bare", "true")
        self._fill(QVBoxLayout(self._content))
        self._area = QScrollArea()
        self._area.setWidgetResizable(True)
        self._area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self._area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self._area.viewport().setAutoFillBackground(False)
        self._area.setWidget(self._content)
        self._footer = QHBoxLayout()
        self._footer.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        self._footer.setSpacing(10)
        self._footer.addStretch(1)
        self._footer.addWidget(self.write)
        self._footer.addWidget(self.show_file)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 14, 1, 16)
        column.setSpacing(10)
        column.addLayout(self._header)
        column.addWidget(self._area, 1)
        self._state_layout = QHBoxLayout()
        self._state_layout.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 0)
        self._state_layout.addWidget(self.state)
        column.addLayout(self._state_layout)
        column.addLayout(self._footer)

    def _fill(self, column: QVBoxLayout) -> None:
        column.setContentsMargins(SIDE_MARGIN, 0, SIDE_MARGIN, 4)
        column.setSpacing(6)
        column.addWidget(self.introduction)
        column.addSpacing(6)
        column.addWidget(label(_("What happened?"), "title"))
        column.addWidget(self.description)
        column.addSpacing(6)
        column.addWidget(label(_("Included"), "title"))
        column.addLayout(self.list)
        column.addSpacing(6)
        column.addWidget(label(_("Not included"), "title"))
        excluded_column = QVBoxLayout()
        excluded_column.setSpacing(4)
        self._excluded_rows = [_PartRow(self.theme, _(text), "x") for text in EXCLUDED_PARTS]
        for line in self._excluded_rows:
            excluded_column.addWidget(line)
        column.addLayout(excluded_column)
        column.addSpacing(6)
        column.addWidget(self.work)
        column.addWidget(self.names)

    def show_for(self, parts: ReportParts, names: Sequence[str], behaviours: ReportedWorkGetter) -> None:
        """Open the sheet.

        Args:
            parts: Sources of the report's contents.
            names: Names of the open behaviours.
            behaviours: Returns the open behaviours with their contents; called only if the user
                includes them.
        """
        self._parts, self._behaviours = parts, behaviours
        while (item := self.list.takeAt(0)) is not None:
            line = item.widget()
            if line is not None:
                line.hide()
                line.deleteLater()
        for text in describe_contents(parts):
            self.list.addWidget(_PartRow(self.theme, text, "check"))
        self._excluded_rows[0].text_label.setText(_(NO_BEHAVIOURS_UNLESS if names else NO_BEHAVIOURS))
        self.work.setChecked(False)
        self.names.setText(work_text(names) if names else "")
        for widget in (self.work, self.names):
            paint.show_when(widget, bool(names))
        if self._writer is None:
            self._set_status("")
        self.open()

    def initial_focus(self) -> QWidget:
        return self.description.edit

    def preferred_size(self, room: QSize) -> QSize:
        buttons = self.write.sizeHint().width() + self.show_file.sizeHint().width() + 2 * SIDE_MARGIN + 40
        width = min(room.width(), max(round(self.theme.scaled(WIDTH)), buttons))
        layout = self._content.layout()
        content_width = width - 2 - SCROLL_BAR_WIDTH
        content_height = layout.totalHeightForWidth(content_width) if layout is not None else 0
        footer_height = self._footer.sizeHint().height()
        if self.state.text():
            footer_height += self.state.heightForWidth(width - 2 - 2 * SIDE_MARGIN) + 10
        height = content_height + self._header.sizeHint().height() + footer_height + 14 + 2 * 10 + 16 + 4
        return QSize(width, min(room.height(), height))

    def _set_status(self, text: str, role: str = "textSecondary", path: Path | None = None) -> None:
        # If there is a path, the button to show the file appears.
        self.written_path = path
        set_role(self.state, role)
        self.state.setText(text)
        paint.show_when(self.state, bool(text))
        paint.show_when(self.show_file, path is not None)
        self.write.setEnabled(self._writer is None)
        self.write.set_kind("plain" if path is not None else "primary")
        if self.isVisible():
            self.place()
            if text:
                paint.announce(self.state, text)

    def _ask_path(self) -> None:
        suggestion = documents_folder() / file_name(self._clock())
        self._dialogs.save_as(
            _("Write report"), suggestion, (ZIP_KIND,), lambda path, _kind: self._start(path)
        )

    def _start(self, path: Path) -> None:
        parts = self._parts
        if parts is None or self._writer is not None:
            return
        description = self.description.text()
        behaviours = tuple(self._behaviours()) if self.work.isChecked() else ()
        # A copy, because settings may change while the thread reads them.
        parts_copy = replace(parts, settings=dict(parts.settings))
        self._writer = ReportWriter(path, lambda: create_report(parts_copy, description, behaviours))
        self._set_status(_("Writing the report."))
        self._poll_timer.start()

    def _check_writer(self) -> None:
        writer = self._writer
        if writer is None or not writer.is_done:
            return
        self._poll_timer.stop()
        self._writer = None
        if writer.problem:
            self._set_status(f"{writer.problem[:1].upper()}{writer.problem[1:]}.", "error")
            message = self.state.text()
        else:
            message = _("Report saved to {file}").format(file=without_home(str(writer.path)))
            self._set_status(message, path=writer.path)
            self.description.set_text("")
        if self.isVisible():
            (self.show_file if not writer.problem else self.write).setFocus(Qt.FocusReason.OtherFocusReason)
        else:
            self._notify(message)

    def _show_file(self) -> None:
        if self.written_path is not None:
            folder = self.written_path.parent
            if not open_externally(QUrl.fromLocalFile(str(folder))):
                self._notify(_("The file is in {folder}").format(folder=folder))


class _PartRow(QWidget):
    """Line that names a part of the report, with an icon for included or omitted."""

    def __init__(self, theme: Theme, text: str, icon: str) -> None:
        super().__init__()
        icon_label = IconLabel(
            theme, icon, "ok" if icon == "check" else "textTertiary", ICON_SIZE, scales=False
        )
        icon_label.setContentsMargins(0, 2, 0, 0)
        self.text_label: QLabel = label(text, "body", wrap=True)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(8)
        row.addWidget(icon_label, 0, Qt.AlignmentFlag.AlignTop)
        row.addWidget(self.text_label, 1)
