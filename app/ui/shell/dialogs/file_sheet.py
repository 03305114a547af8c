"""Sheet to choose a file or folder: locations on the left, contents of the folder, and name below.

Stop stays accessible. Pressing Stop doesn't close the sheet, so that no input is lost.
"""

from __future__ import annotations

import datetime as dt
import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from PySide6.QtCore import QEvent, QObject, QSize, QStandardPaths, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.core.projects.file_format import SUFFIX
from app.core.projects.folder import (
    INVALID_CHARACTERS,
    MAX_NAME_LENGTH,
    FolderEntry,
    entries_of,
    free_name,
    name_problem,
    parse_absolute_path,
)
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text import plain
from app.ui.text.dates import date_time_text
from app.ui.text.numbers import size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ElidedLabel, IconButton, label, paint, set_role
from app.ui.widgets.file_dialogs import (
    BEHAVIOUR_FILTER,
    PICTURE_SUFFIXES,
    FileKind,
    pictures_folder,
    resolve_kind,
)
from app.ui.widgets.inputs.combo_box import ComboBox
from app.ui.widgets.lists.scroll_areas import ScrollColumn
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _, lazy

WIDTH, HEIGHT, LOCATIONS_WIDTH, FOLDER_NAME_WIDTH = 860, 560, 190, 200
NAME_COLUMN, MODIFIED_COLUMN, SIZE_COLUMN = range(3)


@dataclass(frozen=True)
class FileQuestion:
    """Settings of the sheet for one kind of file or folder.

    Attributes:
        heading: Title of the sheet, wrapped in `lazy`.
        verb: Text of the button, wrapped in `lazy`.
        empty: Text that is shown in a folder without matching files.
        suffixes: File extensions of the files to list.
        icon: Icon of the files.
        is_saving: True to ask for a name to save to.
        selects_folder: True to select a folder instead of a file.
        kinds: Formats that are offered for saving.
    """

    heading: str
    verb: str
    empty: str
    suffixes: tuple[str, ...] = (SUFFIX,)
    icon: str = "blocks"
    is_saving: bool = False
    selects_folder: bool = False
    kinds: tuple[FileKind, ...] = (FileKind(BEHAVIOUR_FILTER[0], SUFFIX),)


OPEN_QUESTION = FileQuestion(lazy("Open a behaviour"), lazy("Open"), lazy("No behaviours or folders here."))
SAVE_QUESTION = FileQuestion(
    lazy("Save behaviour"), lazy("Save"), lazy("This folder is empty."), is_saving=True
)
IMAGE_QUESTION = FileQuestion(
    lazy("Choose an image"), lazy("Choose"), lazy("No images or folders here."),
    suffixes=PICTURE_SUFFIXES, icon="image",
)  # fmt: skip
FOLDER_QUESTION = FileQuestion(
    lazy("Choose a folder"), lazy("Use this folder"), "", suffixes=(), selects_folder=True
)


@dataclass(frozen=True)
class FolderLocation:
    """Folder in the list of locations, with its name and icon."""

    name: str
    icon: str
    folder: Path


def known_locations(backup_folder: Path, recent_files: Iterable[Path]) -> tuple[FolderLocation, ...]:
    """Return the folders to list as locations, without missing ones and duplicates.

    Args:
        backup_folder: Folder in which Studio stores backups.
        recent_files: Recent files, whose folders are included.
    """
    kinds = QStandardPaths.StandardLocation
    candidates = [
        FolderLocation(_("Home"), "house", Path.home()),
        FolderLocation(_("Desktop"), "monitor", _standard_folder(kinds.DesktopLocation)),
        FolderLocation(_("Documents"), "file-text", _standard_folder(kinds.DocumentsLocation)),
        FolderLocation(_("Images"), "image", Path(pictures_folder())),
        FolderLocation(_("Backed up by Studio"), "archive", backup_folder),
        *(
            FolderLocation(path.parent.name or str(path.parent), "history", path.parent)
            for path in recent_files
        ),
    ]
    locations: list[FolderLocation] = []
    for location in candidates:
        if location.folder.is_dir() and location.folder not in [each.folder for each in locations]:
            locations.append(location)
    return tuple(locations)


def _standard_folder(kind: QStandardPaths.StandardLocation) -> Path:
    return Path(QStandardPaths.writableLocation(kind) or Path.home())


class _Row(QTreeWidgetItem):
    """Row of a file or folder. Folders precede files in every sort order."""

    def __init__(self, theme: Theme, entry: FolderEntry, now: dt.datetime, icon: str) -> None:
        modified = dt.datetime.fromtimestamp(entry.changed_s, tz=now.tzinfo)
        is_behaviour = not entry.is_folder and entry.path.name.lower().endswith(SUFFIX)
        name = entry.path.name[: -len(SUFFIX)] if is_behaviour else entry.path.name
        size = "" if entry.is_folder else size_text(entry.size_bytes)
        super().__init__([name, date_time_text(modified, now), size])
        self.entry = entry
        self.setIcon(NAME_COLUMN, theme.icon("folder" if entry.is_folder else icon, "textSecondary"))
        self.setTextAlignment(SIZE_COLUMN, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        self.setToolTip(NAME_COLUMN, plain.tip(entry.path.name))

    def __lt__(self, other: QTreeWidgetItem) -> bool:
        tree = self.treeWidget()
        if not isinstance(other, _Row) or tree is None:
            return False
        is_descending = tree.header().sortIndicatorOrder() == Qt.SortOrder.DescendingOrder
        if self.entry.is_folder != other.entry.is_folder:
            return self.entry.is_folder != is_descending
        column = tree.sortColumn()
        if column == MODIFIED_COLUMN:
            return self.entry.changed_s < other.entry.changed_s
        if column == SIZE_COLUMN:
            return self.entry.size_bytes < other.entry.size_bytes
        return self.entry.path.name.casefold() < other.entry.path.name.casefold()


class FileSheet(Overlay):
    """Sheet to choose a file or folder to open, or a file to save to.

    The methods that ask for a path pass the result to a callback, which isn't called on cancel.
    """

    top = 56
    is_nested = True

    def __init__(
        self, theme: Theme, window: QWidget, locations: Callable[[], Sequence[FolderLocation]]
    ) -> None:
        # `locations` is called whenever the sheet opens.
        super().__init__(theme, window, _("Files"))
        self._scrim.pressed.disconnect(self.dismiss)  # a click outside must not discard a typed name
        self._locations = locations
        self._callback: Callable[[Path], object] = lambda _path: None
        self.question = OPEN_QUESTION
        self.folder = Path.home()
        self.heading = label("", "heading")
        self.up = IconButton(theme, "arrow-up", _("Parent folder"), "Alt+Up")
        self.up.clicked.connect(lambda: self.go_to(self.folder.parent))
        self.path = ElidedLabel("body", "textSecondary")
        self.new_folder = Button(theme, _("New folder"), "folder-plus", size="small")
        self.new_folder.clicked.connect(self._start_new_folder)
        self.folder_name = QLineEdit()
        self.folder_name.setPlaceholderText(_("Folder name"))
        self.folder_name.setAccessibleName(_("Folder name"))
        self.create_button = Button(theme, _("Create"), size="small")
        self.create_button.clicked.connect(self._create_folder)
        self.location_list = ScrollColumn(_("Locations"), gap=2)
        self.list = QTreeWidget()
        self.name = QLineEdit()
        self.name.setAccessibleName(_("File name"))
        self.name.textEdited.connect(lambda _text: self._validate())
        self.name.returnPressed.connect(self._accept)
        self.folder_name.returnPressed.connect(self._create_folder)
        for field in (self.name, self.folder_name):
            field.setProperty("focusRadius", theme.radius("control"))
            FieldContextMenu(theme, field)
        self.suffix_label = label(SUFFIX, "bodyLarge", role="textTertiary")
        self.kind = ComboBox(theme, name=_("File type"))
        self.kind.currentIndexChanged.connect(self._on_kind_changed)
        self.hint = label("", "body", role="textSecondary", wrap=True)
        self.cancel = Button(theme, _("Cancel"), size="form")
        self.cancel.clicked.connect(self.dismiss)
        self.keep_both = Button(theme, _("Keep both"), size="form")
        self.keep_both.clicked.connect(self._keep_both)
        self.done = Button(theme, "", kind="primary", size="form")
        self.done.clicked.connect(self._accept)
        self._set_up_list()
        self._lay_out()
        theme.changed.connect(self._reload)

    def _set_up_list(self) -> None:
        tree = self.list
        tree.setAccessibleName(_("Files and folders"))
        tree.setProperty("raised", "true")
        tree.setFrameShape(QFrame.Shape.NoFrame)
        tree.setRootIsDecorated(False)
        tree.setUniformRowHeights(True)
        tree.setHeaderLabels([_("Name"), _("Modified"), _("Size")])
        tree.setSortingEnabled(True)
        tree.sortByColumn(NAME_COLUMN, Qt.SortOrder.AscendingOrder)
        tree.header().setHighlightSections(False)
        tree.header().setStretchLastSection(False)
        tree.header().setSectionResizeMode(NAME_COLUMN, QHeaderView.ResizeMode.Stretch)
        for column in (MODIFIED_COLUMN, SIZE_COLUMN):
            tree.header().setSectionResizeMode(column, QHeaderView.ResizeMode.ResizeToContents)
        tree.itemActivated.connect(self._on_activated)
        tree.currentItemChanged.connect(lambda item, _before: self._on_selected(item))
        tree.itemSelectionChanged.connect(self._validate)
        tree.installEventFilter(self)

    def _lay_out(self) -> None:
        header = self.create_header(self.heading)
        path_row = QHBoxLayout()
        path_row.setSpacing(8)
        path_row.addWidget(self.up)
        path_row.addWidget(self.path, 1)
        for widget in (self.folder_name, self.create_button, self.new_folder):
            path_row.addWidget(widget)
        right = QVBoxLayout()
        right.setSpacing(8)
        right.addLayout(path_row)
        right.addWidget(self.list, 1)
        right.addWidget(self.hint)
        self._name_row = QWidget()
        naming = QHBoxLayout(self._name_row)
        naming.setContentsMargins(0, 0, 0, 0)
        naming.setSpacing(8)
        naming.addWidget(label(_("Name"), "bodyLarge", role="textSecondary"))
        naming.addWidget(self.name, 1)
        naming.addWidget(self.suffix_label)
        naming.addWidget(self.kind)
        right.addWidget(self._name_row)
        footer = QHBoxLayout()
        footer.setSpacing(8)
        footer.addStretch(1)
        for button in (self.cancel, self.keep_both, self.done):
            footer.addWidget(button)
        right.addLayout(footer)
        middle = QHBoxLayout()
        middle.setSpacing(16)
        middle.addWidget(self.location_list)
        middle.addLayout(right, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 14, 20, 16)
        column.setSpacing(12)
        column.addLayout(header)
        column.addLayout(middle, 1)

    def ask_open(
        self, folder: Path, callback: Callable[[Path], object], question: FileQuestion = OPEN_QUESTION
    ) -> None:
        """Ask for a file to open.

        Args:
            folder: Folder to show first.
            callback: Called with the path.
            question: Kind of file, by default a behaviour.
        """
        self._ask(question, folder, callback)

    def ask_picture(self, folder: Path, callback: Callable[[Path], object]) -> None:
        """Ask for an image file to open."""
        self._ask(IMAGE_QUESTION, folder, callback)

    def ask_folder(self, folder: Path, callback: Callable[[Path], object]) -> None:
        """Ask for a folder, which is the selected one or else the displayed one."""
        self._ask(FOLDER_QUESTION, folder, callback)

    def ask_save(self, suggestion: Path, callback: Callable[[Path], object]) -> None:
        """Ask for the folder and name to save a behaviour."""
        self._ask_name(SAVE_QUESTION, suggestion, callback)

    def ask_save_as(
        self,
        title: str,
        suggestion: Path,
        kinds: Sequence[FileKind],
        callback: Callable[[Path, FileKind], object],
    ) -> None:
        """Ask for folder, name and format to save a file other than a behaviour.

        Args:
            title: Title of the sheet.
            suggestion: Suggested path, without extension.
            kinds: Formats that are offered.
            callback: Called with the path and the format.
        """
        suffixes = tuple(dict.fromkeys(each.suffix for each in kinds))
        question = FileQuestion(
            title,
            SAVE_QUESTION.verb,
            SAVE_QUESTION.empty,
            suffixes=suffixes,
            icon="image",
            is_saving=True,
            kinds=tuple(kinds),
        )
        self._ask_name(question, suggestion, lambda path: callback(*resolve_kind(path, self._kind, kinds)))

    def _ask_name(self, question: FileQuestion, suggestion: Path, callback: Callable[[Path], object]) -> None:
        name = suggestion.name.removesuffix(SUFFIX)
        self.name.setText(INVALID_CHARACTERS.sub(" ", name).strip(". ")[:MAX_NAME_LENGTH])
        self.kind.blockSignals(True)
        self.kind.clear()
        for kind in question.kinds:
            self.kind.addItem(_(kind.label))
        self.kind.blockSignals(False)
        self.kind.updateGeometry()
        paint.show_when(self.kind, len(question.kinds) > 1)
        self.suffix_label.setText(question.kinds[0].suffix)
        self._ask(question, suggestion.parent, callback)
        self.name.selectAll()

    @property
    def _kind(self) -> FileKind:
        return self.question.kinds[max(0, self.kind.currentIndex())]

    def _on_kind_changed(self) -> None:
        # Removes a typed file extension, because it would override the chosen format.
        name = self.name.text()
        typed_suffix = next((each for each in self.question.suffixes if name.lower().endswith(each)), "")
        self.name.setText(name[: len(name) - len(typed_suffix)])
        self.suffix_label.setText(self._kind.suffix)
        self._validate()

    def _ask(self, question: FileQuestion, folder: Path, callback: Callable[[Path], object]) -> None:
        self.question, self._callback = question, callback
        heading = _(question.heading)
        self.heading.setText(heading)
        self.setAccessibleName(heading)
        paint.show_when(self._name_row, question.is_saving)
        self._show_folder_field(False)
        self._show_locations()
        self.go_to(folder if folder.is_dir() else Path.home())
        self.open()

    @property
    def is_saving(self) -> bool:
        """True if the sheet asks for a name to save to."""
        return self.question.is_saving

    @property
    def _can_create_folders(self) -> bool:
        return self.is_saving or self.question.selects_folder

    def initial_focus(self) -> QWidget:
        return self.name if self.is_saving else self.list

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        return QSize(min(room.width(), round(scaled(WIDTH))), min(room.height(), round(scaled(HEIGHT))))

    def _focus_changed(self, _old: QWidget | None, _new: QWidget | None) -> None:
        # Unlike other sheets, this one stays open when it loses the focus, as by a press of Stop.
        ...

    def _show_locations(self) -> None:
        column = self.location_list.column
        while column.count() > 1 and (item := column.takeAt(0)) is not None:
            if (old := item.widget()) is not None:
                old.deleteLater()
        for number, location in enumerate(self._locations()):
            button = Button(self.theme, location.name, location.icon, kind="ghost", size="small")
            button.allow_shrinking()
            button.setToolTip(plain.tip(str(location.folder)))
            button.clicked.connect(lambda _on=False, folder=location.folder: self.go_to(folder))
            column.insertWidget(number, button)
        self.location_list.setFixedWidth(round(self.theme.scaled(LOCATIONS_WIDTH)))

    def go_to(self, folder: Path) -> None:
        """Show the contents of a folder.

        If the folder can't be read, the reason is shown and the current folder stays.
        """
        try:
            entries = entries_of(folder, self.question.suffixes)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            self._set_status(
                _("Can't open “{folder}”: {reason}.").format(folder=folder.name, reason=reason), "error"
            )
            return
        previous_folder, self.folder = self.folder, folder
        self.path.setText(str(folder))
        self.up.setEnabled(folder.parent != folder)
        now = dt.datetime.now().astimezone()
        self.list.blockSignals(True)
        self.list.clear()
        row_height = round(self.theme.scaled(self.theme.size("row", "comfortable")))
        side = round(self.theme.scaled(self.theme.size("icon", "normal")))
        self.list.setIconSize(QSize(side, side))
        for entry in entries:
            row = _Row(self.theme, entry, now, self.question.icon)
            row.setSizeHint(NAME_COLUMN, QSize(0, row_height))
            self.list.addTopLevelItem(row)
        self.list.sortItems(self.list.sortColumn(), self.list.header().sortIndicatorOrder())
        previous_row = next((row for row in self._rows() if row.entry.path == previous_folder), None)
        if previous_row is not None:
            self.list.setCurrentItem(previous_row)
        self.list.blockSignals(False)
        self._validate()

    def _rows(self) -> list[_Row]:
        rows = (self.list.topLevelItem(number) for number in range(self.list.topLevelItemCount()))
        return [row for row in rows if isinstance(row, _Row)]

    @property
    def selected_entry(self) -> FolderEntry | None:
        """Selected file or folder in the list, or None."""
        row = self.list.currentItem()
        # QTreeWidget makes the first row current when it gets the focus, which isn't a selection.
        is_selected = row is not None and (row.isSelected() or not self.question.selects_folder)
        return row.entry if is_selected and isinstance(row, _Row) else None

    def _on_selected(self, item: QTreeWidgetItem | None) -> None:
        if self.is_saving and isinstance(item, _Row) and not item.entry.is_folder and self.list.hasFocus():
            self.name.setText(item.text(NAME_COLUMN))
        self._validate()

    def _on_activated(self, item: QTreeWidgetItem) -> None:
        # Return or double click enters a folder, opens a file, or copies its name.
        if isinstance(item, _Row) and item.entry.is_folder:
            self.go_to(item.entry.path)
        elif isinstance(item, _Row) and not self.is_saving:
            self._finish(item.entry.path)
        elif isinstance(item, _Row):
            self.name.setFocus(Qt.FocusReason.OtherFocusReason)

    def _start_new_folder(self) -> None:
        self._show_folder_field(True)
        self.folder_name.clear()
        self.folder_name.setFocus(Qt.FocusReason.OtherFocusReason)

    def _show_folder_field(self, visible: bool) -> None:
        # The text field replaces the "New folder" button.
        self.folder_name.setMinimumWidth(round(self.theme.scaled(FOLDER_NAME_WIDTH)))
        for widget in (self.folder_name, self.create_button):
            paint.show_when(widget, visible and self._can_create_folders)
        paint.show_when(self.new_folder, self._can_create_folders and not visible)

    def _create_folder(self) -> None:
        name = self.folder_name.text().strip()
        problem = name_problem(name) or ("" if name else _("Enter a folder name."))
        if not problem and (self.folder / name).exists():
            problem = _("“{name}” already exists.").format(name=name)
        if not problem:
            try:
                (self.folder / name).mkdir()
            except OSError as error:
                reason = (error.strerror or str(error)).lower()
                problem = _("Can't create “{name}”: {reason}.").format(name=name, reason=reason)
        if problem:
            self._set_status(problem, "error")
            return
        self._show_folder_field(False)
        self.go_to(self.folder / name)
        self.initial_focus().setFocus(Qt.FocusReason.OtherFocusReason)

    @property
    def target(self) -> Path | None:
        """Path that the primary button passes to the callback, or None if the button is disabled."""
        selected = self.selected_entry
        if self.question.selects_folder:
            return selected.path if selected is not None else self.folder
        if not self.is_saving:
            return selected.path if selected is not None and not selected.is_folder else None
        name = self.name.text().strip()
        suffix = next((e for e in self.question.suffixes if name.lower().endswith(e)), self._kind.suffix)
        if name.lower().endswith(suffix):
            name = name[: -len(suffix)]
        path = parse_absolute_path(name)
        if path is not None:
            return path.with_name(f"{path.name}{suffix}") if path.parent.is_dir() else None
        return self.folder / f"{name}{suffix}" if name and not name_problem(name) else None

    def _validate(self) -> None:
        # Shows the effect of the button, such as overwriting a file, and sets its text.
        target = self.target
        already_exists = self.is_saving and target is not None and target.exists()
        paint.show_when(self.keep_both, already_exists)
        self.done.set_label(_("Replace") if already_exists else _(self.question.verb))
        selected = self.selected_entry
        wants_folder = self.question.selects_folder
        opens_folder = not self.is_saving and not wants_folder and selected is not None and selected.is_folder
        parent_folder = target if wants_folder else target.parent if target else self.folder
        is_writable = not self._can_create_folders or os.access(parent_folder or self.folder, os.W_OK)
        self.done.setEnabled((target is not None and is_writable) or opens_folder)
        problem = self._problem() if self.is_saving else ""
        if problem:
            self._set_status(problem, "error")
        elif not is_writable:
            self._set_status(
                _("You don't have permission to save in this folder. Choose another folder."), "error"
            )
        elif already_exists and target is not None:
            name = target.name.removesuffix(SUFFIX)
            self._set_status(
                _("“{name}” already exists. Replace it, or keep both.").format(name=name), "text"
            )
        elif wants_folder and target is not None:
            name = target.name or str(target)
            self._set_status(_("Files will be saved in “{folder}”.").format(folder=name), "text")
        elif not self.list.topLevelItemCount():
            self._set_status(_(self.question.empty), "textSecondary")
        else:
            self._set_status("", "textSecondary")

    def _problem(self) -> str:
        name = self.name.text().strip()
        path = parse_absolute_path(name)
        if path is None:
            return name_problem(name)
        return (
            ""
            if path.parent.is_dir()
            else _("The folder “{folder}” doesn't exist.").format(folder=path.parent)
        )

    def _set_status(self, text: str, role: str) -> None:
        if self.hint.text() == text:
            return
        self.hint.setText(text)
        set_role(self.hint, role)
        paint.show_when(self.hint, bool(text))
        if text:
            paint.announce(self.hint, text)

    def _accept(self) -> None:
        target, selected = self.target, self.selected_entry
        if target is not None and self.done.isEnabled():
            self._finish(target)
        elif not self.is_saving and selected is not None and selected.is_folder:
            self.go_to(selected.path)

    def _keep_both(self) -> None:
        target = self.target
        if target is not None:
            name = free_name(target.parent, target.stem, target.suffix)
            self._finish(target.with_name(f"{name}{target.suffix}"))

    def _finish(self, path: Path) -> None:
        self.dismiss()
        self._callback(path)

    def _reload(self) -> None:
        if self.isVisible():
            self._show_locations()
            self.go_to(self.folder)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Open the parent folder when Backspace is pressed in the list."""
        if (
            watched is self.list
            and event.type() == QEvent.Type.KeyPress
            and isinstance(event, QKeyEvent)
            and event.key() == Qt.Key.Key_Backspace
        ):
            self.go_to(self.folder.parent)
            return True
        return super().eventFilter(watched, event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        if event.key() == Qt.Key.Key_Up and event.modifiers() & Qt.KeyboardModifier.AltModifier:
            self.go_to(self.folder.parent)
        super().keyPressEvent(event)
