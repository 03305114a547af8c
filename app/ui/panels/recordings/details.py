"""What can be done with the chosen recording: open, rename, show the file, export."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QSizePolicy, QVBoxLayout, QWidget

from app.core.recording.exporting import RecordingExport
from app.core.recording.folder import RecordingFacts
from app.ui.text.numbers import grouped
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, ElidedLabel, Segments, Separator, ValueBar, label
from app.ui.widgets.flow_layout import Flow
from nep.i18n import _, lazy, ngettext

BAR_PX = 120
FORMAT_WORDS = {
    "csv": lazy("CSV"), "parquet": lazy("Parquet"), "pictures": lazy("Pictures"), "mp4": lazy("MP4"),
}  # fmt: skip
"""As what a recording is exported, by the names of `nep.recordings.export`."""


class RecordingDetails(QWidget):
    """Below the table. `wants_export` tells the format of one, `cancelled` that it is given up."""

    wants_export = Signal(str)
    cancelled = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Maximum)
        self.name = ElidedLabel("title", "text", least=60)
        self.counts = label("", "small", role="textSecondary", wrap=True)
        self.open = Button(theme, _("Open"), "play", size="small")
        self.rename = Button(theme, _("Rename"), "pencil", size="small")
        self.show_file = Button(theme, _("Show the file"), "folder-open", size="small")
        self.delete = Button(theme, _("Delete"), "trash-2", size="small")
        formats = [(kind, _(words), None) for kind, words in FORMAT_WORDS.items()]
        self.format = Segments(theme, formats, size="small", name=_("Export as"), wraps=True)
        self.export = Button(theme, _("Export"), "download", size="small")
        self.export.clicked.connect(self._press)
        self.bar = ValueBar(theme)
        self.bar.setFixedWidth(round(theme.scaled(BAR_PX)))
        self.progress = label("", "small", role="textSecondary")
        self._is_exporting = False
        acts, exports = Flow(gap=8, row_gap=6), Flow(gap=8, row_gap=6)
        for button in (self.open, self.rename, self.show_file, self.delete):
            acts.addWidget(button)
        for part in (label(_("Export as"), "small"), self.format, self.export, self.bar, self.progress):
            exports.addWidget(part)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(Separator(theme))
        inside = QVBoxLayout()
        inside.setContentsMargins(12, 8, 12, 10)
        inside.setSpacing(8)
        inside.addWidget(self.name)
        inside.addWidget(self.counts)
        inside.addLayout(acts)
        inside.addLayout(exports)
        column.addLayout(inside)
        self.show_export(None)

    def show_facts(self, facts: RecordingFacts, being_written: bool) -> None:
        """Say this of the recording, and let be done what can be."""
        self.name.setText(facts.path.stem)
        topics, count = len(facts.topics), facts.message_count
        self.counts.setText(
            facts.problem
            or _("{topics}, {messages}").format(
                topics=ngettext("{count} topic", "{count} topics", topics).format(count=grouped(topics)),
                messages=ngettext("{count} message", "{count} messages", count).format(count=grouped(count)),
            )
        )
        can_read = not being_written and not facts.problem
        self.open.setEnabled(can_read)
        self.export.setEnabled(self._is_exporting or (can_read and facts.is_read))
        self.rename.setEnabled(not being_written)
        self.delete.setEnabled(not being_written)

    def show_export(self, job: RecordingExport | None) -> None:
        """How far an export is; None while none goes on."""
        self._is_exporting = job is not None
        self.export.set_word(_("Cancel") if job is not None else _("Export"), "x" if job else "download")
        self.format.setEnabled(job is None)
        self.bar.setVisible(job is not None)
        self.progress.setVisible(job is not None)
        if job is not None:
            self.export.setEnabled(not job.was_cancelled)
            share = job.share
            self.bar.set_fraction(share)
            words = _("Exporting") if share is None else _("Exporting, {percent} %")
            self.progress.setText(words.format(percent=round(100 * (share or 0.0))))

    def _press(self) -> None:
        if self._is_exporting:
            self.cancelled.emit()
        else:
            self.wants_export.emit(self.format.value)
