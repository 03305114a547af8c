"""Recordings panel: list of the recordings folder, which is scanned in a background thread."""

from __future__ import annotations

import datetime as dt
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QEvent, QFile, Qt, QUrl
from PySide6.QtGui import QAction, QImage, QKeyEvent
from PySide6.QtWidgets import QVBoxLayout

from app.core.messages.picture import Picture
from app.core.recording.exporting import RecordingExport
from app.core.recording.film_strip import FilmStripPreview, read_preview
from app.core.recording.folder import FolderScan, RecordingFolder, RecordingInfo, read_picture
from app.core.recording.opener import RecordingOpener
from app.core.recording.topic_choice import file_stem
from app.core.recording.topic_choice import free_path as free
from app.core.storage.background_worker import BackgroundWorker
from app.core.storage.settings import Settings
from app.ui.intents import OpenRecording, SelectRecording
from app.ui.other_programs import open_externally
from app.ui.panels.base import Density, Panel, PanelContext
from app.ui.panels.command import IntentHandler
from app.ui.panels.home import TabHome
from app.ui.panels.record.recordings.columns import THUMBNAIL_SIZE, columns, crop_to_thumbnail
from app.ui.panels.record.recordings.details import RecordingDetails
from app.ui.panels.record.recordings.table import RecordingTable
from app.ui.panels.row_actions import RowAction
from app.ui.panels.table_panel import TablePanel, TableTexts
from app.ui.text.numbers import group_digits, size_text
from app.ui.widgets import ContentScrollArea, EmptyAction, label
from app.ui.widgets.keyboard import has_no_modifiers
from app.ui.widgets.table.model import TableModel
from nep.i18n import _, lazy, ngettext
from nep.system.replace_file import replace_file

TABLE_TEXTS = TableTexts(
    title=lazy("Recordings"),
    filter=lazy("Filter names, notes and topics"),
    no_matches=lazy("No matching recordings"),
    clear_filter_hint=lazy("Clear the filter to see all recordings."),
)
ROW_HEIGHT = 56
SCAN_INTERVAL_TICKS = 30  # refreshes at 30 Hz
FIRST_SCAN_TICK = 1
MAX_CACHED_PICTURES = 300
STRIP_PICTURES, STRIP_BARS, STRIP_SIZE = 8, 120, (240, 142)
SIDECAR_SUFFIX = ".bookmarks.json"


class RecordingsPanel(TablePanel[RecordingInfo]):
    """Panel with the table of recordings and, below it, the details of the selected one."""

    def __init__(self, context: PanelContext) -> None:
        self._recordings = context.session.recordings
        self._folder = RecordingFolder(self._recordings.folder, self._recordings.new_opener())
        self._opener = self._recordings.new_opener()
        self._scan = FolderScan(is_complete=False)
        self._has_scanned = False
        self._pictures: OrderedDict[tuple[Path, float, int], QImage | None] = OrderedDict()
        self._requested_thumbnails: dict[str, tuple[Path, float, int]] = {}
        self._thumbnail_worker: BackgroundWorker[tuple[QImage | None]] = BackgroundWorker(
            "recordings-pictures"
        )
        self._export_job: RecordingExport | None = None
        self._strip_worker: BackgroundWorker[tuple[FilmStripPreview | None, Sequence[QImage | None]]] = (
            BackgroundWorker("recordings-strip")
        )
        self._strip_key: tuple[Path, float, int] | None = None
        self._last_loop_ns: tuple[int, int] | None = None
        self._ticks, self._requested_path, self._recorder_revision = 0, "", -1
        super().__init__(context, TABLE_TEXTS, "film")
        self.count_label = label("", "small", role="textSecondary")
        self.header.insert(0, self.count_label)
        self.details = RecordingDetails(self.theme)
        self._details_area = ContentScrollArea(self.details)
        self._connect()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget, stretch in ((self.pages, 1), (self.line, 0), (self.foot, 0), (self._details_area, 0)):
            column.addWidget(widget, stretch)
        self.foot.hide()
        self.line.hide()
        self._details_area.hide()

    def _connect(self) -> None:
        details = self.details
        self.table.selected.connect(lambda _key: self._show_details())  # type: ignore[attr-defined]
        self.table.rename_requested.connect(self._rename)  # type: ignore[attr-defined]
        self.table.delete_requested.connect(self._delete)  # type: ignore[attr-defined]
        details.open_button.clicked.connect(lambda: self._run_on_selected(self.open_row))
        details.rename_button.clicked.connect(lambda: self._run_on_selected(self._rename))
        details.delete_button.clicked.connect(lambda: self._run_on_selected(self._delete))
        details.show_file_button.clicked.connect(lambda: self._run_on_selected(self._show_file))
        details.export_requested.connect(self._export)
        details.cancelled.connect(self._cancel_export)
        details.choose_button.clicked.connect(self._select_folder)

    def make_model(self) -> TableModel[RecordingInfo]:
        table_columns = columns(self._picture, self._is_being_written, lambda: dt.datetime.now().astimezone())
        return TableModel(table_columns, lambda info: str(info.path))

    def make_table(self, model: TableModel[RecordingInfo]) -> RecordingTable:
        return RecordingTable(self.theme, model)

    # -- display ------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        self._ticks += 1
        recordings = self._recordings
        if recordings.folder != self._folder.folder:
            self._folder.close()
            self._folder = RecordingFolder(recordings.folder, recordings.new_opener())
            self._ticks = FIRST_SCAN_TICK
        revision = recordings.client.revision
        has_changed = revision != self._recorder_revision
        if self._ticks % SCAN_INTERVAL_TICKS == FIRST_SCAN_TICK:
            self._folder.start_scan(recordings.client.state.path if recordings.is_recording else None)
        scan = self._folder.pop_result()
        if scan is not None:
            self._scan, self._has_scanned = scan, True
        if scan is not None or has_changed:
            self._recorder_revision = revision
            self.rebuild()
        if self._collect_thumbnails():
            self.table.refresh_visible()
        self._poll_strip()
        self._poll_export()

    def rebuild(self) -> None:
        keywords = self.filter_words()
        recordings = [self._with_live_state(each) for each in self._scan.files]
        rows = [each for each in recordings if all(keyword in _haystack(each) for keyword in keywords)]
        self.model.set_rows(self.table.order.sort(rows))
        self.table.refresh_visible()
        if self._requested_path and self.model.index_of(self._requested_path).isValid():
            self.table.select_key(self._requested_path)
            self._requested_path = ""
        self._update_counts(recordings)
        self.show_table(bool(rows), bool(keywords) and bool(recordings))
        self._show_details()

    def _with_live_state(self, info: RecordingInfo) -> RecordingInfo:
        # Size and duration of a recording in progress come from the recorder.
        if not self._is_being_written(info):
            return info
        state = self._recordings.client.state
        return replace(
            info,
            size_bytes=max(info.size_bytes, state.size_bytes),
            duration_s=state.duration_s,
            message_count=state.message_count,
            lost=state.lost + state.unwritten_count,
            topics=tuple(sorted(state.topics))[:3],
        )

    def _is_being_written(self, info: RecordingInfo) -> bool:
        state = self._recordings.client.state
        return bool(state.phase) and info.path == state.path

    def _update_counts(self, recordings: Sequence[RecordingInfo]) -> None:
        count = len(recordings) + self._scan.omitted_count
        template = ngettext("{count} recording, {size}", "{count} recordings, {size}", count)
        size = size_text(sum(each.size_bytes for each in recordings))
        self.count_label.setText(template.format(count=group_digits(count), size=size) if count else "")
        self.filter.setVisible(count > 0)
        omitted_count = self._scan.omitted_count
        template = ngettext(
            "{count} older recording not listed", "{count} older recordings not listed", omitted_count
        )
        self.foot.setText(template.format(count=group_digits(omitted_count)) if omitted_count else "")
        self.foot.setVisible(bool(omitted_count))
        self.line.setVisible(bool(omitted_count))

    def show_table(self, has_rows: bool, is_filtered: bool) -> None:
        if has_rows or is_filtered:
            super().show_table(has_rows, is_filtered)
            return
        self.pages.setCurrentIndex(1)
        self.update_empty_state()

    def update_empty_state(self) -> None:
        folder = self._recordings.folder
        is_own = self.session.settings.is_stored(Settings.recordings_folder)
        if not self._has_scanned:
            text = _("Recordings in this folder appear here in a moment.")
            self.empty.set_texts(_("Reading the folder"), text, "folder-open")
            self.empty.set_actions([])
        elif self._scan.problem and is_own:
            text = _("{folder}: {reason}.").format(folder=folder, reason=self._scan.problem)
            self.empty.set_texts(_("The recordings folder doesn't exist"), text, "folder-open")
            choose = EmptyAction(_("Choose a folder"), lambda: self.context.run("recording.folder"), "folder")
            self.empty.set_actions([choose])
        else:
            text = _("Start recording, or save the last seconds after something has happened.")
            self.empty.set_texts(_("No recordings yet"), text, "film")
            record = EmptyAction(
                _("Record"), lambda: self.context.run("recording.toggle"), "circle-dot", is_primary=True
            )
            self.empty.set_actions([record, self.doctor_action()])

    def _show_details(self) -> None:
        info = self._selected()
        self._details_area.setVisible(info is not None)
        if info is not None:
            self.details.show_recording(info, self._is_being_written(info))
        self._request_strip(info)

    def _selected(self) -> RecordingInfo | None:
        return self.model.row_at(self.table.currentIndex())

    # -- pictures -----------------------------------------------------------------------------------------

    def _picture(self, info: RecordingInfo) -> QImage | None:
        # Missing thumbnails are requested from a background thread.
        if not info.is_read or info.problem or info.scan_problem:
            return None
        picture_key = (info.path, info.changed_s, info.size_bytes)
        if picture_key in self._pictures:
            self._pictures.move_to_end(picture_key)
            return self._pictures[picture_key]
        path_key = str(info.path)
        if self._requested_thumbnails.get(path_key) != picture_key:
            self._requested_thumbnails[path_key] = picture_key
            self._thumbnail_worker.submit(path_key, lambda: (_load_thumbnail(info.path, self._opener),))
        return None

    def _collect_thumbnails(self) -> bool:
        has_collected = False
        for path_key, picture_key in list(self._requested_thumbnails.items()):
            result = self._thumbnail_worker.pop_result(path_key)
            if result is not None:
                has_collected = True
                del self._requested_thumbnails[path_key]
                self._pictures[picture_key] = result[0]
        while len(self._pictures) > MAX_CACHED_PICTURES:
            self._pictures.popitem(last=False)
        return has_collected

    # -- film strip ---------------------------------------------------------------------------------------

    def _request_strip(self, info: RecordingInfo | None) -> None:
        # Loads the film strip in a background thread.
        can_read = info is not None and info.is_read and not info.problem and not self._is_being_written(info)
        strip_key = (info.path, info.changed_s, info.size_bytes) if info is not None and can_read else None
        if strip_key == self._strip_key:
            return
        self._strip_key, self._last_loop_ns = strip_key, None
        self.details.show_strip(None)
        if strip_key is not None:
            path = strip_key[0]
            self._strip_worker.submit("strip", lambda: _load_strip(path, self._opener))

    def _poll_strip(self) -> None:
        # Shows the film strip once it is loaded; a loop on the timeline becomes the selected part.
        result = self._strip_worker.pop_result("strip")
        if result is not None:
            preview, images = result
            if preview is not None and self._strip_key is not None and preview.path == self._strip_key[0]:
                self.details.show_strip(preview, images)
                self._last_loop_ns = None
        replay, preview = self.session.replay, self.details.strip.preview
        player = replay.player if replay is not None else None
        if preview is None or replay is None or player is None or replay.path != preview.path:
            return
        loop_ns = player.loop if player.is_looping else None
        if loop_ns != self._last_loop_ns:
            self._last_loop_ns = loop_ns
            if loop_ns is not None:
                self.details.strip.set_part(*loop_ns)

    # -- user actions -------------------------------------------------------------------------------------

    def _run_on_selected(self, action: Callable[[str], object]) -> None:
        info = self._selected()
        if info is not None:
            action(str(info.path))

    def open_row(self, key: str) -> None:
        self.context.request(OpenRecording(Path(key)))

    def row_actions(self, key: str) -> Sequence[RowAction]:
        return (
            RowAction(_("Open"), "play", lambda: self.open_row(key)),
            RowAction(_("Rename"), "pencil", lambda: self._rename(key)),
            RowAction(_("Show the file"), "folder-open", lambda: self._show_file(key)),
            RowAction(_("Delete"), "trash-2", lambda: self._delete(key)),
        )

    def select_file(self, path: Path | None) -> None:
        """Select a recording as soon as it appears in the list; None has no effect."""
        if path is None:
            return
        self.filter.clear()
        self._requested_path = str(path)
        self._ticks = 0
        self.rebuild()

    def _recording_info(self, key: str) -> RecordingInfo | None:
        return self.model.row_at(self.model.index_of(key))

    def _rename(self, key: str) -> None:
        info = self._recording_info(key)
        if info is None or self._is_being_written(info):
            self.context.show_toast(_("A recording can be renamed after it has ended"))
            return
        table = self.table
        if isinstance(table, RecordingTable):
            table.rename(key, info.path.stem, lambda name: self._apply_name(info.path, name))

    def _apply_name(self, path: Path, name: str) -> bool:
        stem = file_stem(name)
        if stem == path.stem:
            return True
        if not stem:
            self.context.show_toast(_("Enter a name for the recording"))
            return False
        new_path = path.with_name(f"{stem}{path.suffix}")
        if new_path.exists():
            self.context.show_toast(_("A recording named “{name}” already exists").format(name=stem))
            return False
        if not self._move_files(path, new_path):
            return False
        self._requested_path = str(new_path)
        self._update_listing(path, new_path)
        return True

    def _move_files(self, path: Path, new_path: Path) -> bool:
        try:
            replace_file(path, new_path)
            sidecar = path.with_name(path.name + SIDECAR_SUFFIX)
            if sidecar.exists():
                replace_file(sidecar, new_path.with_name(new_path.name + SIDECAR_SUFFIX))
        except OSError as error:
            message = _("Can't rename {file}: {reason}")
            self.context.show_toast(
                message.format(file=path.name, reason=(error.strerror or str(error)).lower())
            )
            return False
        return True

    def _update_listing(self, path: Path, new_path: Path | None) -> None:
        # Shown before the next scan confirms the change.
        files = [
            replace(each, path=new_path) if each.path == path and new_path is not None else each
            for each in self._scan.files
            if each.path != path or new_path is not None
        ]
        self._scan = replace(self._scan, files=tuple(files))
        self._ticks = 0
        self.rebuild()

    def _delete(self, key: str) -> None:
        info = self._recording_info(key)
        if info is None or self._is_being_written(info):
            self.context.show_toast(_("A recording can be deleted after it has ended"))
            return
        path = info.path
        file = QFile(str(path))
        if not file.moveToTrash():
            message = _("Can't move {file} to the bin: {reason}")
            self.context.show_toast(message.format(file=path.name, reason=file.errorString().lower()))
            return
        self._update_listing(path, None)
        self.table.setFocus(Qt.FocusReason.OtherFocusReason)
        trash_path = Path(file.fileName())
        message = _("Moved “{name}” to the bin").format(name=path.stem)
        if trash_path != path and trash_path.is_file():
            self.context.show_toast(message, _("Undo"), lambda: self._restore_deleted(trash_path, path))
        else:
            self.context.show_toast(message)

    def _restore_deleted(self, trash_path: Path, path: Path) -> None:
        try:
            replace_file(trash_path, free(path))
            trash_info = trash_path.parent.parent / "info" / f"{trash_path.name}.trashinfo"
            trash_info.unlink(missing_ok=True)
        except OSError as error:
            message = _("Can't restore {file}: {reason}")
            self.context.show_toast(
                message.format(file=path.name, reason=(error.strerror or str(error)).lower())
            )
            return
        self._requested_path = str(path)
        self._ticks = 0

    def _show_file(self, key: str) -> None:
        path = Path(key)
        if not open_externally(QUrl.fromLocalFile(str(path.parent))):
            self.context.show_toast(_("File: {path}").format(path=path))

    # -- export -------------------------------------------------------------------------------------------

    def _export(self, kind: str) -> None:
        info, part = self._selected(), self.details.part()
        if info is None or self._export_job is not None:
            return
        if part is None:
            self.context.show_toast(_("No matching topics in this recording"))
            return
        folder = free(self.details.export_path() or info.path.with_suffix(""), is_folder=True)
        self._export_job = RecordingExport(info.path, kind, folder, part, self._recordings.new_opener())
        self.details.show_export(self._export_job)

    def _select_folder(self) -> None:
        info = self._selected()
        if info is not None:
            folder = self.details.folder or info.path.parent
            self.context.files.select_folder(str(folder), self.details.set_folder)

    def _cancel_export(self) -> None:
        if self._export_job is not None:
            self._export_job.cancel()

    def _poll_export(self) -> None:
        job = self._export_job
        if job is None:
            return
        if not job.is_finished:
            self.details.show_export(job)
            return
        self._export_job = None
        self.details.show_export(None)
        self._show_details()
        if job.files:
            self.context.show_toast(
                job.result_text(), _("Show"), lambda: self._show_file(str(job.files[0].path))
            )
        else:
            self.context.show_toast(job.result_text())

    # -- overrides ----------------------------------------------------------------------------------------

    def event(self, event: QEvent) -> bool:
        # Within the panel, F2 renames the recording; otherwise the window's shortcut would rename the
        # behaviour.
        if isinstance(event, QKeyEvent) and event.key() == Qt.Key.Key_F2 and has_no_modifiers(event):
            if event.type() == QEvent.Type.ShortcutOverride:
                event.accept()
                return True
            if event.type() == QEvent.Type.KeyPress:
                self._run_on_selected(self._rename)
                return True
        return super().event(event)

    def row_height(self) -> int:
        return round(self.theme.scaled(ROW_HEIGHT))

    def set_density(self, density: Density) -> None:
        super().set_density(density)
        self._fit_header()

    def theme_changed(self) -> None:
        super().theme_changed()
        self._fit_header()

    def _fit_header(self) -> None:
        # Same header height as in other tables, despite the taller rows.
        self.table.horizontalHeader().setFixedHeight(super().row_height() + 1)

    def more_actions(self) -> list[QAction]:
        folder = QAction(self.theme.icon("folder-open"), _("Folder for recordings"), self)
        folder.triggered.connect(lambda _on=False: self.context.run("recording.folder"))
        return [*super().more_actions(), folder]

    def dispose(self) -> None:
        self._folder.close()
        self._opener.close()
        self._thumbnail_worker.close()
        self._strip_worker.close()
        if self._export_job is not None:
            self._export_job.close()


def _load_thumbnail(path: Path, opener: RecordingOpener) -> QImage | None:
    # Runs in a background thread.
    picture = read_picture(path, (2 * THUMBNAIL_SIZE.width(), 2 * THUMBNAIL_SIZE.height()), opener)
    return crop_to_thumbnail(_convert_picture(picture)).copy() if picture is not None else None


def _convert_picture(picture: Picture) -> QImage:
    pixels = picture.bgra
    height, width = pixels.shape[:2]
    return QImage(pixels.tobytes(), width, height, width * 4, QImage.Format.Format_RGB32).copy()


def _load_strip(
    path: Path, opener: RecordingOpener
) -> tuple[FilmStripPreview | None, Sequence[QImage | None]]:
    # Runs in a background thread.
    preview = read_preview(path, STRIP_PICTURES, STRIP_BARS, STRIP_SIZE, opener)
    if preview is None:
        return None, ()
    return preview, [_convert_picture(each) if each is not None else None for each in preview.pictures]


def _haystack(info: RecordingInfo) -> str:
    return " ".join((info.path.stem, info.note, *info.topics)).casefold()


PANEL = Panel(
    "recordings",
    TABLE_TEXTS.title,
    "film",
    (),
    RecordingsPanel,
    home=(TabHome("developer", "topics"), TabHome("behaviour", "behaviour")),
    intents=(IntentHandler(SelectRecording, lambda panel, intent: panel.select_file(intent.path)),),
)
