"""Details of the selected recording, with actions to open, rename, export and delete it."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QImage
from PySide6.QtWidgets import QGridLayout, QSizePolicy, QVBoxLayout, QWidget

from app.core.recording.exporting import RecordingExport
from app.core.recording.film_strip import FilmStripPreview, select_part
from app.core.recording.folder import RecordingInfo
from app.core.recording.topic_choice import file_stem
from app.core.timeline.times import duration_text
from app.ui.panels.record.recordings.film_strip import FilmStrip
from app.ui.panels.record.recordings.topic_list import TopicList, shortest_choice
from app.ui.text import plain
from app.ui.text.numbers import group_digits, size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    ElidedLabel,
    Segments,
    Separator,
    ToggleButton,
    ValueBar,
    label,
    set_role,
)
from app.ui.widgets.flow_layout import Flow
from app.ui.widgets.inputs.pattern_field import PatternField
from nep.errors import BadTopicError
from nep.i18n import _, lazy, ngettext
from nep.recordings.export import FULL_RECORDING, Part, can_export

BAR_WIDTH_PX = 120
FORMAT_LABELS = {
    "csv": lazy("CSV"), "parquet": lazy("Parquet"), "pictures": lazy("Images"), "mp4": lazy("MP4"),
    "mcap": lazy("MCAP"),
}  # fmt: skip
"""Displayed names of the export formats of `nep.recordings.export`."""


class RecordingDetails(QWidget):
    """Details of the selected recording.

    Signals:
        export_requested: Export format, when the user starts an export.
        cancelled: The user cancelled the running export.
    """

    export_requested = Signal(str)
    cancelled = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self.name_label = ElidedLabel("title", "text", min_width=60)
        self.counts_label = label("", "small", role="textSecondary", wrap=True)
        self.open_button = Button(theme, _("Open"), "play", size="small")
        self.rename_button = Button(theme, _("Rename"), "pencil", size="small")
        self.show_file_button = Button(theme, _("Show the file"), "folder-open", size="small")
        self.delete_button = Button(theme, _("Delete"), "trash-2", size="small")
        formats = [(kind, _(text), None) for kind, text in FORMAT_LABELS.items()]
        self.format_choice = Segments(theme, formats, size="small", name=_("Export as"), wraps=True)
        self._make_export_fields()
        self.export_button = Button(theme, _("Export"), "download", size="small")
        self.export_button.clicked.connect(self._toggle_export)
        self.progress_bar = ValueBar(theme)
        self.progress_bar.setFixedWidth(round(theme.scaled(BAR_WIDTH_PX)))
        self.progress_label = label("", "small", role="textSecondary")
        self._is_exporting = False
        self._arrange()
        self.show_export(None)
        self.show_strip(None)

    def _make_export_fields(self) -> None:
        # Time range, topics and folder of the export.
        theme = self._theme
        self.strip = FilmStrip(theme)
        self.strip.changed.connect(self._update_part)
        self.topics_field = PatternField(theme, _("Topics to export"), _("all topics; or /odom *camera*"))
        self.topics_field.changed.connect(self._patterns_edited)
        self._is_none_chosen = False
        self.list_button = ToggleButton(theme, _("Choose from list"), "list")
        self.topic_list = TopicList(theme)
        self.topic_list.hide()
        self.list_button.toggled.connect(self._set_list_visible)
        self.topic_list.selection_changed.connect(self._topics_checked)
        times = [("start", _("From start"), None), ("clock", _("Clock"), None)]
        self.time_mode = Segments(theme, times, size="small", name=_("Times"))
        self.time_mode.changed.connect(lambda value: self.strip.set_clock_mode(value == "clock"))
        self.part_label = label("", "small", role="textSecondary", wrap=True)
        self.size_label = label("", "small", role="textSecondary", wrap=True)
        tooltip = _("Size of the messages. The files can be smaller or larger.")
        self.size_label.setToolTip(plain.tip(tooltip))
        self.format_choice.changed.connect(lambda _kind: self._update_part())
        self._recording: Path | None = None
        self.folder: Path | None = None
        """Folder for exports chosen by the user, or None for the folder of the recording."""
        self.folder_label = ElidedLabel("body", "text", min_width=60)
        self.file_count_label = label("", "small", role="textSecondary")
        self.choose_button = Button(theme, _("Choose"), "folder-open", size="small")
        self.choose_button.setAccessibleName(_("Choose the export folder"))

    def _arrange(self) -> None:
        actions = Flow(gap=8, row_gap=6)
        actions.add_elastic(self.name_label)
        actions.addWidget(self.counts_label)
        actions.push()
        for button in (self.open_button, self.rename_button, self.show_file_button, self.delete_button):
            actions.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Separator(self._theme))
        content = QVBoxLayout()
        content.setContentsMargins(12, 8, 12, 10)
        content.setSpacing(8)
        content.addLayout(actions)
        content.addWidget(self.strip)
        content.addLayout(self._form())
        column.addLayout(content)

    def _form(self) -> QGridLayout:
        # One row per choice; rows wrap in a narrow panel.
        kinds, topics, times, folder_row = (Flow(gap=8, row_gap=6) for _row in range(4))
        kinds.addWidget(self.format_choice)
        topics.add_elastic(self.topics_field, is_greedy=True)
        topics.addWidget(self.list_button)
        times.addWidget(self.time_mode)
        for row, description in ((kinds, self.size_label), (times, self.part_label)):
            row.push()
            row.addWidget(description)
        folder_row.add_elastic(self.folder_label, is_greedy=True)
        for widget in (
            self.file_count_label,
            self.choose_button,
            self.export_button,
            self.progress_bar,
            self.progress_label,
        ):
            folder_row.addWidget(widget)
        form = QGridLayout()
        form.setHorizontalSpacing(12)
        form.setVerticalSpacing(8)
        form.setColumnStretch(1, 1)
        rows = (
            (_("Export as"), kinds),
            (_("Topics"), topics),
            (_("Times"), times),
            (_("Save in"), folder_row),
        )
        for index, (title, row) in enumerate(rows):
            name = label(title, "small", role="textSecondary")
            form.addWidget(name, 2 * index, 0, Qt.AlignmentFlag.AlignTop)
            name.setMinimumHeight(self.format_choice.sizeHint().height())
            form.addLayout(row, 2 * index, 1)
        form.addWidget(self.topic_list, 3, 1)
        return form

    def show_recording(self, info: RecordingInfo, is_being_written: bool) -> None:
        """Show the properties of a recording and enable the possible actions.

        Args:
            info: Properties of the recording.
            is_being_written: True for the recording in progress.
        """
        self.name_label.setText(info.path.stem)
        self._recording = info.path
        self._update_export_path()
        topics, count = len(info.topics), info.message_count
        self.counts_label.setText(
            info.problem
            or info.scan_problem
            or _("{topics}, {messages}").format(
                topics=ngettext("{count} topic", "{count} topics", topics).format(count=group_digits(topics)),
                messages=ngettext("{count} message", "{count} messages", count).format(
                    count=group_digits(count)
                ),
            )
        )
        can_read = not is_being_written and not info.problem
        self.open_button.setEnabled(can_read)
        self.export_button.setEnabled(self._is_exporting or (can_read and info.is_read))
        self.rename_button.setEnabled(not is_being_written)
        self.delete_button.setEnabled(not is_being_written)

    def show_strip(self, preview: FilmStripPreview | None, images: Sequence[QImage | None] = ()) -> None:
        """Show another recording on the film strip and select all of it for export.

        Args:
            preview: Contents of the film strip; None while they are loading.
            images: Images of the film strip; None for images that are not loaded.
        """
        self.strip.show_preview(preview, images)
        self.topics_field.show_patterns((), ())
        self._is_none_chosen = False
        self.set_folder(None)
        self._update_part()

    def set_folder(self, folder: Path | None) -> None:
        """Set the folder for exports; None for the folder of the recording."""
        self.folder = folder
        self._update_export_path()

    def export_path(self) -> Path | None:
        """Return the path for the export, or None without a recording.

        The path contains the selected time range and the format; it may exist already.
        """
        if self._recording is None:
            return None
        strip, name = self.strip, self._recording.stem
        if not strip.is_all_selected and strip.preview is not None:
            times = [
                duration_text(time_ns - strip.preview.start_ns, digits=1)
                for time_ns in (strip.begin_ns, strip.end_ns)
            ]
            begin, end = (each.replace(":", ".") for each in times)
            name = _("{name}, {begin} to {end}").format(name=name, begin=begin, end=end)
        kind = _(FORMAT_LABELS[self.format_choice.value])
        return (self.folder or self._recording.parent) / file_stem(f"{name}, {kind}")

    def _update_export_path(self) -> None:
        path = self.export_path()
        self.folder_label.setText(f"{path.parent.name}/{path.name}" if path is not None else "")
        self.folder_label.setToolTip(plain.tip(str(path or "")))

    def _patterns_edited(self) -> None:
        self._is_none_chosen = False
        self._update_part()

    def part(self) -> Part | None:
        """Return the part to export; None if no topic is selected or a pattern is invalid.

        Until the preview is loaded, this is the full recording.
        """
        preview = self.strip.preview
        if preview is None:
            return FULL_RECORDING
        if self._is_none_chosen:
            return None
        included, excluded = self.topics_field.patterns()
        try:
            part = select_part(preview, self.strip.begin_ns, self.strip.end_ns, included, excluded)
        except BadTopicError:
            return None
        return part if part.topics is None or part.topics else None

    def _set_list_visible(self, is_visible: bool) -> None:
        self.topic_list.setVisible(is_visible)
        self._update_part()

    def _topics_checked(self, names: Sequence[str]) -> None:
        # Called when topics are checked or unchecked in the list.
        preview = self.strip.preview
        self._is_none_chosen = not names
        if preview is not None and names:
            self.topics_field.show_patterns(*shortest_choice(preview.topics, names))
        self._update_part()

    def _update_part(self) -> None:
        # Time range, number of topics and size.
        preview, part = self.strip.preview, self.part()
        if preview is not None and not self.topic_list.isHidden():
            all_names = (
                [each.name for each in preview.topics] if part is not None and part.topics is None else ()
            )
            names = all_names if part is None else part.topics or all_names
            self.topic_list.show_topics(preview.topics, names, preview.size_of)
        self.topics_field.set_invalid(is_invalid=part is None)
        set_role(self.part_label, "error" if part is None else "textSecondary")
        self._update_size(preview, part)
        self._update_export_path()
        if preview is None:
            self.part_label.setText("")
            return
        if part is None:
            self.part_label.setText(_("No matching topics in this recording"))
            return
        count = len(preview.topics if part.topics is None else part.topics)
        template = ngettext("{count} of {all} topics", "{count} of {all} topics", len(preview.topics))
        text = template.format(count=group_digits(count), all=group_digits(len(preview.topics)))
        if not self.strip.is_all_selected:
            times_ns = (self.strip.begin_ns, self.strip.end_ns)
            begin, end = (self.strip.time_text(at_ns, digits=1) for at_ns in times_ns)
            text = _("{begin} to {end}, {topics}").format(begin=begin, end=end, topics=text)
        self.part_label.setText(text)

    def _update_size(self, preview: FilmStripPreview | None, part: Part | None) -> None:
        # Estimated from the topics that the format supports.
        text, count = "", 0
        if preview is not None and part is not None:
            names = {
                each.name
                for each in preview.topics
                if (part.topics is None or each.name in part.topics)
                and can_export(self.format_choice.value, each.codec)
            }
            text = (
                self._size_text(preview, names)
                if names
                else _("None of the selected topics can be exported in this format")
            )
            count = min(len(names), 1) if self.format_choice.value == "mcap" else len(names)
        self.size_label.setText(text)
        self.file_count_label.setText(
            ngettext("{count} file", "{count} files", count).format(count=group_digits(count))
        )
        self.file_count_label.setVisible(count > 0)

    def _size_text(self, preview: FilmStripPreview, names: Collection[str]) -> str:
        exact_count, size = preview.estimate_messages(self.strip.begin_ns, self.strip.end_ns, names)
        count = round(exact_count if self.strip.is_all_selected else float(f"{exact_count:.2g}"))
        messages = ngettext("{count} message", "{count} messages", count).format(count=group_digits(count))
        if size is None:
            return messages if self.strip.is_all_selected else _("about {messages}").format(messages=messages)
        template = (
            _("{messages}, about {size}") if self.strip.is_all_selected else _("about {messages}, {size}")
        )
        return template.format(messages=messages, size=size_text(size))

    def show_export(self, job: RecordingExport | None) -> None:
        """Show the progress of an export, or hide it if `job` is None."""
        self._is_exporting = job is not None
        self.export_button.set_label(
            _("Cancel") if job is not None else _("Export"), "x" if job else "download"
        )
        for field in (
            self.format_choice,
            self.strip,
            self.topics_field,
            self.choose_button,
            self.time_mode,
            self.list_button,
            self.topic_list,
        ):
            field.setEnabled(job is None)
        self.progress_bar.setVisible(job is not None)
        self.progress_label.setVisible(job is not None)
        if job is not None:
            self.export_button.setEnabled(not job.was_cancelled)
            fraction = job.progress
            self.progress_bar.set_fraction(fraction)
            template = _("Exporting") if fraction is None else _("Exporting, {percent} %")
            self.progress_label.setText(template.format(percent=round(100 * (fraction or 0.0))))

    def _toggle_export(self) -> None:
        if self._is_exporting:
            self.cancelled.emit()
        else:
            self.export_requested.emit(self.format_choice.value)
