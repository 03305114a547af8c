"""Columns of the table of recordings: thumbnail, name, note, and properties."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable
from dataclasses import dataclass, field

from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QImage, QPainter, QPainterPath

from app.core.recording.folder import RecordingInfo
from app.ui.text.dates import date_time_text
from app.ui.text.numbers import group_digits, length_text, size_text
from app.ui.theme.icons import paint_icon
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.table.model import Cell, Column
from nep.i18n import _, lazy

THUMBNAIL_SIZE = QSize(64, 48)
GAP, CHIP_HEIGHT, CHIP_PADDING = 14, 18, 8
BADGES = {
    "recording": (lazy("recording"), "error", "circle-dot"),
    "unreadable": (lazy("can't be read"), "error", "circle-x"),
    "cut": (lazy("incomplete"), "warn", "triangle-alert"),
    "repaired": (lazy("repaired"), "info", "wrench"),
    "kept": (lazy("last seconds"), "off", "history"),
}
"""Text, status and icon of each badge, by key."""


def badge_of(info: RecordingInfo, is_being_written: bool) -> str:
    """Return the key in `BADGES` of a recording's badge, or "" for no badge.

    Args:
        info: Properties of the recording.
        is_being_written: True for the recording in progress.
    """
    if is_being_written:
        return "recording"
    if info.problem:
        return "unreadable"
    if not info.is_read:
        return ""
    if info.is_repaired:
        return "repaired"
    if not info.is_complete:
        return "cut"
    return "kept" if info.is_from_flight_recorder else ""


@dataclass(frozen=True)
class RecordingMark:
    """Table cell with thumbnail, name, badge and note.

    Attributes:
        name: Name of the recording.
        note: Second line, or "".
        badge: Key in `BADGES`, or "".
        picture_id: Cache key of the thumbnail, by which cells are compared; 0 without a thumbnail.
        picture: Thumbnail, or None.
    """

    name: str
    note: str
    badge: str
    picture_id: int
    picture: QImage | None = field(compare=False)

    def paint(self, painter: QPainter, box: QRectF, theme: Theme) -> None:
        pixel_scale = theme.scaled(1.0)
        picture_rect = QRectF(
            box.left(), 0, THUMBNAIL_SIZE.width() * pixel_scale, THUMBNAIL_SIZE.height() * pixel_scale
        )
        picture_rect.moveCenter(QPointF(picture_rect.center().x(), box.center().y()))
        self._paint_picture(painter, picture_rect, theme)
        text_rect = QRectF(box)
        text_rect.setLeft(picture_rect.right() + GAP)
        name_font, note_font = theme.font("label"), theme.font("small")
        name_font.setWeight(name_font.Weight.DemiBold)
        name_height, note_height = paint.height_of(name_font), paint.height_of(note_font)
        top = box.center().y() - (name_height + (note_height if self.note else 0)) / 2
        chip = self._chip_width(theme)
        max_name_width = max(0.0, text_rect.width() - (chip + 8 if chip else 0))
        name_width = min(paint.width_of(name_font, self.name) + 1, max_name_width)
        paint.text_line(
            painter,
            QRectF(text_rect.left(), top, name_width, name_height),
            self.name,
            name_font,
            theme.colour("text"),
        )
        if chip:
            chip_rect = QRectF(
                text_rect.left() + name_width + 8, top + name_height / 2 - CHIP_HEIGHT / 2, chip, CHIP_HEIGHT
            )
            self._paint_chip(painter, chip_rect, theme)
        if self.note:
            note_rect = QRectF(text_rect.left(), top + name_height, text_rect.width(), note_height)
            paint.text_line(painter, note_rect, self.note, note_font, theme.colour("textSecondary"))

    def _paint_picture(self, painter: QPainter, rect: QRectF, theme: Theme) -> None:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        radius = theme.radius("key")
        paint.box(painter, rect, radius, theme.colour("sunken"))
        if self.picture is None:
            icon = QRectF(0, 0, 18, 18)
            icon.moveCenter(rect.center())
            paint_icon(painter, icon, "chart-line", theme.colour("textTertiary"))
            return
        clip_path = QPainterPath()
        clip_path.addRoundedRect(rect, radius, radius)
        painter.save()
        painter.setClipPath(clip_path)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(rect, self.picture)
        painter.restore()

    def _chip_width(self, theme: Theme) -> float:
        if not self.badge:
            return 0.0
        return paint.width_of(theme.font("caption"), _(BADGES[self.badge][0])) + 2 * CHIP_PADDING + 16

    def _paint_chip(self, painter: QPainter, box: QRectF, theme: Theme) -> None:
        text, status_name, icon = BADGES[self.badge]
        status = theme.status(status_name)
        colour = theme.colour("textSecondary" if status_name == "off" else status.colour)
        paint.box(painter, box, box.height() / 2, theme.colour(status.tint or "sunken"))
        paint_icon(painter, QRectF(box.left() + CHIP_PADDING - 2, box.center().y() - 6, 12, 12), icon, colour)
        text_rect = box.adjusted(CHIP_PADDING + 13, 0, -2, 0)
        paint.text_line(painter, text_rect, _(text), theme.font("caption"), colour)


def crop_to_thumbnail(image: QImage) -> QImage:
    """Crop an image to the aspect ratio of thumbnails, and scale it to twice their size.

    The size is doubled for high-DPI screens. An empty image is returned unchanged.
    """
    width, height = image.width(), image.height()
    if not width or not height:
        return image
    aspect_ratio = THUMBNAIL_SIZE.width() / THUMBNAIL_SIZE.height()
    crop_width = min(width, round(height * aspect_ratio))
    crop_height = min(height, round(width / aspect_ratio))
    cropped = image.copy(
        (width - crop_width) // 2, (height - crop_height) // 2, max(1, crop_width), max(1, crop_height)
    )
    return cropped.scaled(2 * THUMBNAIL_SIZE.width(), 2 * THUMBNAIL_SIZE.height())


def note_of(info: RecordingInfo) -> str:
    """Return the second line of a row: the error, the note, or the names of the first topics."""
    return info.problem or info.scan_problem or info.note or ", ".join(info.topics[:3])


def columns(
    picture: Callable[[RecordingInfo], QImage | None],
    is_being_written: Callable[[RecordingInfo], bool],
    now: Callable[[], dt.datetime],
) -> tuple[Column[RecordingInfo], ...]:
    """Return the columns of the table.

    Args:
        picture: Returns the thumbnail of a recording, or None if it is not loaded.
        is_being_written: Returns True for the recording in progress.
        now: Returns the current local time.
    """

    def name_cell(info: RecordingInfo) -> Cell:
        image = picture(info)
        badge = badge_of(info, is_being_written(info))
        note = note_of(info)
        mark = RecordingMark(info.path.stem, note, badge, image.cacheKey() if image else 0, image)
        text = ", ".join(filter(None, (info.path.stem, _(BADGES[badge][0]) if badge else "", note)))
        return Cell(mark=mark, accessible_text=text)

    def date_cell(info: RecordingInfo) -> Cell:
        seconds = info.start_ns / 1e9 if info.start_ns else info.changed_s
        date = dt.datetime.fromtimestamp(min(max(seconds, 0.0), 4e10), tz=dt.timezone.utc).astimezone()
        return Cell(date_time_text(date, now()))

    def length_cell(info: RecordingInfo) -> Cell:
        return Cell(length_text(info.duration_s) if info.message_count else "")

    def lost_cell(info: RecordingInfo) -> Cell:
        if info.lost is None:
            return Cell()
        return Cell(
            group_digits(info.lost),
            "triangle-alert" if info.lost else None,
            "warn" if info.lost else "text",
        )

    return (
        Column("name", lazy("Recording"), 280, name_cell, key=lambda info: info.path.stem.casefold(),
               stretch=True, tip=lambda info: str(info.path)),
        Column("when", lazy("Recorded"), 148, date_cell,
               key=lambda info: info.start_ns or info.changed_s * 1e9, hide_order=1),
        Column("length", lazy("Length"), 68, length_cell, key=lambda info: info.duration_s,
        is_numeric=True), Column("size", lazy("Size"), 72, lambda info: Cell(size_text(info.size_bytes)),
               key=lambda info: info.size_bytes, is_numeric=True, hide_order=2),
        Column("messages", lazy("Messages"), 84,
               lambda info: Cell(group_digits(info.message_count) if info.message_count else ""),
               key=lambda info: info.message_count, is_numeric=True, hide_order=4),
        Column("lost", lazy("Lost"), 92, lost_cell, key=lambda info: info.lost, is_numeric=True,
        hide_order=3),
    )  # fmt: skip
