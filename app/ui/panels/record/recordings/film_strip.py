"""Film strip: timeline of a recording with images, and two handles to select a part of it."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QEvent, QRectF, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.core.recording.film_strip import FilmStripPreview
from app.core.timeline.times import clock_text, duration_text
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from nep.i18n import _

FILM_HEIGHT, LABEL_HEIGHT, HANDLE_WIDTH = 71, 18, 8
STEP_NS, BIG_STEP_NS = 1_000_000_000, 10_000_000_000
UNSELECTED_OPACITY = 0.35


class StripHandle(QWidget):
    """Handle at one end of the selected part. The arrow keys move the handle by 1 s, with Shift by 10 s.

    Signals:
        moved: Shift in ns, when a key was pressed.
        dragged: New x coordinate, while the handle is dragged.
        reset: The handle was double-clicked.
    """

    moved = Signal(object)
    dragged = Signal(float)
    reset = Signal()

    def __init__(self, theme: Theme, strip: QWidget, name: str) -> None:
        super().__init__(strip)
        self._theme = theme
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.SplitHCursor)
        self.setAccessibleName(name)
        self.setProperty("focusRadius", theme.radius("small"))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        is_big_step = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        step = BIG_STEP_NS if is_big_step else STEP_NS
        if event.key() in {Qt.Key.Key_Left, Qt.Key.Key_Right}:
            self.moved.emit(-step if event.key() == Qt.Key.Key_Left else step)
        elif event.key() in {Qt.Key.Key_Home, Qt.Key.Key_End}:
            self.moved.emit(-(2**62) if event.key() == Qt.Key.Key_Home else 2**62)
        else:
            super().keyPressEvent(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        event.accept()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if event.buttons() & Qt.MouseButton.LeftButton:
            self.dragged.emit(self.mapToParent(event.position()).x())

    def mouseDoubleClickEvent(self, _event: QMouseEvent) -> None:
        self.reset.emit()

    def paintEvent(self, _event: QPaintEvent) -> None:
        painter = QPainter(self)
        paint.box(painter, QRectF(self.rect()), 3, self._theme.colour("accent"))
        grip_rect = QRectF(self.width() / 2 - 1, self.height() / 2 - 7, 2, 14)
        painter.fillRect(grip_rect, self._theme.colour("onAccent"))
        painter.end()


class FilmStrip(QWidget):
    """Film strip of one recording.

    Attributes:
        preview: Contents of the film strip, or None.
        begin_ns: Start of the selected part, in ns since 1970.
        end_ns: End of the selected part, in ns since 1970.

    Signals:
        changed: The selected part changed.
    """

    changed = Signal()

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.preview: FilmStripPreview | None = None
        self._images: Sequence[QImage | None] = ()
        self.begin_ns = self.end_ns = 0
        self.is_clock_mode = False
        """True to show times of day, False to show times relative to the start of the recording."""
        self.begin = StripHandle(theme, self, _("Start of the selected range"))
        self.end = StripHandle(theme, self, _("End of the selected range"))
        self.begin.moved.connect(lambda by_ns: self.set_part(self.begin_ns + by_ns, self.end_ns))
        self.end.moved.connect(lambda by_ns: self.set_part(self.begin_ns, self.end_ns + by_ns))
        self.begin.dragged.connect(lambda x: self.set_part(self._time_at(x), self.end_ns))
        self.end.dragged.connect(lambda x: self.set_part(self.begin_ns, self._time_at(x)))
        for handle in (self.begin, self.end):
            handle.reset.connect(self.select_all)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        theme.changed.connect(self._arrange)

    # -- display ------------------------------------------------------------------------------------------

    def show_preview(self, preview: FilmStripPreview | None, images: Sequence[QImage | None] = ()) -> None:
        """Show a recording and select all of it.

        Args:
            preview: Contents of the film strip; None hides the film strip.
            images: Images of the film strip; None for images that are not loaded.
        """
        self.preview, self._images = preview, images
        self.select_all()
        self.setVisible(preview is not None)

    def select_all(self) -> None:
        """Select the whole recording."""
        if self.preview is not None:
            self.set_part(self.preview.start_ns, self.preview.end_ns)

    def set_part(self, begin_ns: int, end_ns: int) -> None:
        """Select a part of the recording.

        Args:
            begin_ns: Start in ns since 1970. Both times are limited to the recording and to each other.
            end_ns: End in ns since 1970.
        """
        preview = self.preview
        if preview is None:
            return
        begin_ns = max(preview.start_ns, min(begin_ns, preview.end_ns))
        end_ns = max(preview.start_ns, min(end_ns, preview.end_ns))
        if begin_ns > end_ns:  # each handle stops at the other one
            begin_ns, end_ns = (end_ns, end_ns) if begin_ns != self.begin_ns else (begin_ns, begin_ns)
        self.begin_ns, self.end_ns = begin_ns, end_ns
        for handle, at_ns in ((self.begin, begin_ns), (self.end, end_ns)):
            handle.setAccessibleDescription(self.time_text(at_ns, digits=1))
        self._arrange()
        self.changed.emit()

    def time_text(self, at_ns: int, *, digits: int) -> str:
        """Format a time relative to the start ("6:40.0") or as time of day ("15:08:40.0").

        Args:
            at_ns: Time in ns since 1970.
            digits: Number of decimals of the seconds.
        """
        if self.is_clock_mode:
            return clock_text(at_ns, digits=digits)
        return duration_text(
            at_ns - (self.preview.start_ns if self.preview is not None else 0), digits=digits
        )

    def set_clock_mode(self, is_clock_mode: bool) -> None:
        """Show times of day if `is_clock_mode` is True, else times relative to the start."""
        self.is_clock_mode = is_clock_mode
        self.set_part(self.begin_ns, self.end_ns)
        self.update()

    @property
    def is_all_selected(self) -> bool:
        """True if the whole recording is selected."""
        preview = self.preview
        return preview is None or (self.begin_ns, self.end_ns) == (preview.start_ns, preview.end_ns)

    # -- geometry -----------------------------------------------------------------------------------------

    def sizeHint(self) -> QSize:
        return QSize(360, round(self._theme.scaled(FILM_HEIGHT) + self._theme.scaled(LABEL_HEIGHT)))

    def minimumSizeHint(self) -> QSize:
        return QSize(120, self.sizeHint().height())

    def _film_rect(self) -> QRectF:
        # Leaves room for the handles at both ends.
        height = self._theme.scaled(FILM_HEIGHT)
        return QRectF(HANDLE_WIDTH, 0, max(1.0, self.width() - 2 * HANDLE_WIDTH), height)

    def _x_of(self, at_ns: int) -> float:
        film, preview = self._film_rect(), self.preview
        if preview is None or preview.end_ns <= preview.start_ns:
            return film.left()
        return film.left() + (at_ns - preview.start_ns) / (preview.end_ns - preview.start_ns) * film.width()

    def _time_at(self, x: float) -> int:
        film, preview = self._film_rect(), self.preview
        if preview is None:
            return 0
        return preview.start_ns + round(
            (x - film.left()) / film.width() * (preview.end_ns - preview.start_ns)
        )

    def _arrange(self) -> None:
        height = round(self._film_rect().height())
        begin, end = self._x_of(self.begin_ns), self._x_of(self.end_ns)
        if self.preview is not None and self.preview.end_ns <= self.preview.start_ns:
            end = self._film_rect().right()
        self.begin.setGeometry(round(begin) - HANDLE_WIDTH, 0, HANDLE_WIDTH, height)
        self.end.setGeometry(round(end), 0, HANDLE_WIDTH, height)
        self.updateGeometry()
        self.update()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._arrange()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        # Moves the handle nearest to the mouse.
        if self.preview is None or event.button() != Qt.MouseButton.LeftButton:
            return
        x = event.position().x()
        is_begin = abs(x - self._x_of(self.begin_ns)) <= abs(x - self._x_of(self.end_ns))
        handle = self.begin if is_begin else self.end
        handle.setFocus(Qt.FocusReason.MouseFocusReason)
        handle.dragged.emit(x)

    def changeEvent(self, event: QEvent) -> None:
        super().changeEvent(event)
        if event.type() == QEvent.Type.EnabledChange:
            self.update()

    # -- painting -----------------------------------------------------------------------------------------

    def paintEvent(self, _event: QPaintEvent) -> None:
        preview, theme = self.preview, self._theme
        if preview is None:
            return
        painter, film = QPainter(self), self._film_rect()
        painter.fillRect(film, theme.colour("sunken"))
        if any(image is not None for image in self._images):
            self._paint_pictures(painter, film)
        else:
            self._paint_counts(painter, film, preview.counts)
        dim_colour = QColor(theme.colour("panel"))
        dim_colour.setAlphaF(1.0 - UNSELECTED_OPACITY)
        begin, end = float(self.begin.geometry().right() + 1), float(self.end.geometry().left())
        painter.fillRect(QRectF(film.left(), 0, max(0.0, begin - film.left()), film.height()), dim_colour)
        painter.fillRect(QRectF(end, 0, max(0.0, film.right() - end), film.height()), dim_colour)
        if not self.is_all_selected:
            for y in (0.0, film.height() - 2):
                painter.fillRect(QRectF(begin, y, max(0.0, end - begin), 2), theme.colour("accent"))
        self._paint_labels(painter, film, preview)
        painter.end()

    def _paint_pictures(self, painter: QPainter, film: QRectF) -> None:
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        count = len(self._images)
        for index, image in enumerate(self._images):
            if image is None or image.isNull():
                continue
            frame_width = film.width() / count
            box = QRectF(film.left() + index * frame_width, 0, frame_width - 1, film.height())
            aspect_ratio = box.width() / box.height()
            crop_width = min(float(image.width()), image.height() * aspect_ratio)
            crop_height = min(float(image.height()), image.width() / aspect_ratio)
            source_rect = QRectF(
                (image.width() - crop_width) / 2, (image.height() - crop_height) / 2, crop_width, crop_height
            )
            painter.drawImage(box, image, source_rect)

    def _paint_counts(self, painter: QPainter, film: QRectF, counts: Sequence[int]) -> None:
        peak = max(counts, default=0)
        if not peak:
            return
        bar_width, colour = film.width() / len(counts), self._theme.colour("textTertiary")
        for index, count in enumerate(counts):
            bar_height = count / peak * (film.height() - 8)
            painter.fillRect(
                QRectF(
                    film.left() + index * bar_width,
                    film.height() - 4 - bar_height,
                    max(1.0, bar_width - 1),
                    bar_height,
                ),
                colour,
            )

    def _paint_labels(self, painter: QPainter, film: QRectF, preview: FilmStripPreview) -> None:
        # Labels of the ends and of the selection, as far as they don't overlap.
        theme, font = self._theme, self._theme.font("small")
        height = theme.scaled(LABEL_HEIGHT)
        occupied: list[tuple[float, float]] = []
        digits = 0 if preview.end_ns - preview.start_ns > STEP_NS else 3
        for at_ns, role in (
            (self.begin_ns, "accentText"), (self.end_ns, "accentText"),
            (preview.start_ns, "textSecondary"), (preview.end_ns, "textSecondary"),
        ):  # fmt: skip
            text = self.time_text(at_ns, digits=digits)
            width = paint.width_of(font, text) + 2
            left = max(0.0, min(self.width() - width, self._x_of(at_ns) - width / 2))
            if any(left < end + 6 and left + width > begin - 6 for begin, end in occupied):
                continue
            occupied.append((left, left + width))
            is_end = at_ns in {preview.start_ns, preview.end_ns}
            colour = theme.colour("textSecondary" if is_end else role)
            paint.text_line(painter, QRectF(left, film.height(), width, height), text, font, colour)
