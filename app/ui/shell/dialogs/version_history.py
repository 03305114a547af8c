"""Sheet with the version history of a behaviour; a version can be opened as a copy."""

from __future__ import annotations

import datetime as dt
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QObject, QSize, Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QHBoxLayout, QVBoxLayout, QWidget

from app.blocks.model.project import Project
from app.core.projects.block_diff import Difference, difference
from app.core.projects.file_format import read_file
from app.core.projects.versions import Version, namesakes_of, versions_of
from app.errors import DocumentError
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text.dates import date_time_text
from app.ui.text.numbers import group_digits
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, EmptyAction, EmptyState, label, paint
from app.ui.widgets.lists.entry_list import EntryList, Heading, Line
from app.ui.widgets.lists.fuzzy import Entry, Match
from nep.i18n import _, day_text, lazy, ngettext

WIDTH, MAX_HEIGHT, EMPTY_HEIGHT = 680, 560, 330
HINT = lazy("Opens a copy in a new tab. Your file doesn't change.")
NO_VERSIONS_TEXT = lazy(
    "Studio keeps the previous version of a file each time it is saved, saved under another "
    "name, or closed with unsaved work."
)
SAVE_FIRST_TEXT = lazy(
    "Save the behaviour to a file. From then on Studio keeps the previous version each time you save."
)


def difference_text(diff: Difference) -> str:
    """Format the difference of a version from the current blocks.

    The text is such as "14 blocks, 3 added, 1 removed since".
    """
    counts = (
        (diff.added_count, ngettext("{count} added", "{count} added", diff.added_count)),
        (diff.removed_count, ngettext("{count} removed", "{count} removed", diff.removed_count)),
        (diff.changed_count, ngettext("{count} changed", "{count} changed", diff.changed_count)),
    )
    changes = ", ".join(text.format(count=count) for count, text in counts if count)
    blocks = ngettext("{count} block", "{count} blocks", diff.block_count).format(
        count=group_digits(diff.block_count)
    )
    if changes:
        return _("{blocks}, {changes} since").format(blocks=blocks, changes=changes)
    template = _("{blocks}, reordered") if diff.is_rearranged else _("{blocks}, unchanged since")
    return template.format(blocks=blocks)


class VersionHistorySheet(Overlay):
    """Sheet with the version history of one behaviour.

    Versions are read one at a time, so that the window stays responsive.
    """

    top = 72

    def __init__(
        self,
        theme: Theme,
        window: QWidget,
        open_copy: Callable[[Path, str], object],
        save: Callable[[], object],
    ) -> None:
        # `open_copy` gets the file of a version and a name for the copy.
        super().__init__(theme, window, _("Earlier versions"))
        self._open_copy, self._save = open_copy, save
        self._current_project = Project.of_blocks("", {})
        self._versions: dict[str, Version] = {}
        self._unread_ids: deque[str] = deque()
        self.heading = label("", "heading", wrap=True)
        self.rows = EntryList(theme, _("Earlier versions"))
        self.rows.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.empty = EmptyState(theme, "history", "", "")
        self.hint = label(_(HINT), "body", role="textSecondary", wrap=True)
        self.button = Button(theme, _("Open a copy"), "file-plus", kind="primary", size="form")
        self._read_timer = QTimer(self)
        self._read_timer.timeout.connect(self._read_next)
        self._lay_out()
        self.rows.installEventFilter(self)
        self.rows.doubleClicked.connect(lambda _index: self.open_selected())
        self.button.clicked.connect(self.open_selected)

    def _lay_out(self) -> None:
        header = self.create_header(self.heading)
        header.setContentsMargins(19, 0, 19, 0)
        self._footer = QWidget()
        self._footer.setProperty("bare", "true")
        footer = QHBoxLayout(self._footer)
        footer.setContentsMargins(19, 0, 19, 0)
        footer.setSpacing(12)
        footer.addWidget(self.hint, 1)
        footer.addWidget(self.button)
        column = QVBoxLayout(self)
        column.setContentsMargins(1, 14, 1, 14)
        column.setSpacing(10)
        column.addLayout(header)
        column.addWidget(self.rows, 1)
        column.addWidget(self.empty, 1)
        column.addWidget(self._footer)

    def show_for(
        self,
        project: Project,
        path: Path | None,
        now: dt.datetime | None = None,
        title: str = "",
    ) -> None:
        """Open the sheet with the versions of a file, compared with the current blocks.

        Args:
            project: Current content of the behaviour.
            path: File of the behaviour, or None if it isn't saved to a file.
            now: Current time, for the formatted dates; default: the system time.
            title: Name with folder, if another open behaviour has the same name.
        """
        self._current_project, name = project, project.name
        moment = now if now is not None else dt.datetime.now().astimezone()
        own_versions = versions_of(path) if path is not None else []
        namesakes = namesakes_of(path) if path is not None else []
        self._versions = {f"version:{each.copy}": each for each in (*own_versions, *namesakes)}
        self._unread_ids = deque(self._versions)
        lines: list[Line] = [self._version_entry(each, moment) for each in own_versions]
        if namesakes:
            lines += [
                Heading(_("Versions of other files named {name}").format(name=name)),
                *(self._version_entry(each, moment) for each in namesakes),
            ]
        self.heading.setText(_("Earlier versions of {name}").format(name=title or name))
        self.setAccessibleName(self.heading.text())
        self._show_empty_state(name, path)
        for widget, needs_lines in ((self.rows, True), (self._footer, True), (self.empty, False)):
            paint.show_when(widget, needs_lines == bool(lines))
        self.rows.show_lines(lines)
        self._read_timer.start(0)
        self.open()

    def _show_empty_state(self, name: str, path: Path | None) -> None:
        if path is None:
            self.empty.set_texts(_("{name} isn't saved to a file yet").format(name=name), _(SAVE_FIRST_TEXT))
            self.empty.set_actions([EmptyAction(_("Save"), self._save_behaviour, "save", is_primary=True)])
        else:
            self.empty.set_texts(_("No earlier versions yet"), _(NO_VERSIONS_TEXT))
            self.empty.set_actions([EmptyAction(_("Close"), self.dismiss)])

    def _version_entry(self, version: Version, now: dt.datetime) -> Match:
        written = dt.datetime.fromtimestamp(version.written_s, tz=now.tzinfo)
        return Match(Entry(f"version:{version.copy}", date_time_text(written, now), "history"))

    def initial_focus(self) -> QWidget:
        return self.rows if self._versions else self.empty.findChild(Button) or self

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        width = min(room.width(), round(scaled(WIDTH)))
        layout = self.layout()
        if not self._versions or layout is None:
            return QSize(width, min(room.height(), round(scaled(EMPTY_HEIGHT))))
        other_height = layout.totalHeightForWidth(width) - self.rows.sizeHint().height()
        height = other_height + self.rows.content_height() + 8
        return QSize(width, min(room.height(), round(scaled(MAX_HEIGHT)), height))

    def _read_next(self) -> None:
        if not self._unread_ids or not self.isVisible():
            self._read_timer.stop()
            return
        id = self._unread_ids.popleft()
        note = reason = ""
        try:
            version = self._versions[id]
            note = difference_text(difference(read_file(version.copy, version.name), self._current_project))
        except DocumentError as error:
            reason = error.reason
        self.rows.update_entry(id, note, reason)

    @property
    def has_read_all(self) -> bool:
        """True once all versions were read and compared."""
        return not self._unread_ids

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self.rows and event.type() == QEvent.Type.KeyPress:
            key = cast("QKeyEvent", event).key()
            if key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
                self.open_selected()
                return True
            return self.rows.handle_key(key)
        return super().eventFilter(watched, event)

    def open_selected(self) -> None:
        """Open the selected version as a copy, unless it can't be read."""
        entry = self.rows.entry
        if entry is None or entry.reason:
            return
        version = self._versions[entry.id]
        written = dt.datetime.fromtimestamp(version.written_s).astimezone()
        self.dismiss()
        name = _("{name}, {day} {clock}").format(
            name=self._current_project.name,
            day=day_text(written.day, written.month),
            clock=f"{written.hour}.{written.minute:02d}",
        )
        self._open_copy(version.copy, name)

    def _save_behaviour(self) -> None:
        self.dismiss()
        self._save()
