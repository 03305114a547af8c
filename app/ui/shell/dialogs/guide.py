"""Guide with searchable help pages in the user's language.

The pages are Markdown files in ``resources/guide``, with one folder per language. ``{key:run.stop}`` is
replaced by the current shortcut of a command. ``![words](name)`` includes the image ``light/name.png``
or ``dark/name.png``, depending on the theme; the words are its alternative text.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from PySide6.QtCore import QEvent, QObject, QSize, Qt, QTimer, QUrl
from PySide6.QtGui import (
    QFont,
    QImage,
    QKeyEvent,
    QPainter,
    QPalette,
    QResizeEvent,
    QTextBlock,
    QTextBlockFormat,
    QTextCursor,
    QTextDocument,
    QTextFormat,
    QTextFrameFormat,
    QTextTable,
)
from PySide6.QtWidgets import (
    QFrame,
    QHBoxLayout,
    QListWidget,
    QListWidgetItem,
    QTextBrowser,
    QVBoxLayout,
    QWidget,
)

from app.core.storage.atomic_file import read_regular_file
from app.ui.shell.dialogs.overlay import Overlay
from app.ui.text import plain
from app.ui.text.numbers import shortcut_text
from app.ui.theme.theme import Theme
from app.ui.widgets import SearchField, label, paint
from nep.i18n import ENGLISH, _, ngettext

WIDTH, HEIGHT, LIST_WIDTH = 920, 640, 220
LINE_HEIGHT_PERCENT = 115.0
IMAGE_PIXEL_RATIO = 1.5
"""Pixels of an image file per logical pixel; greater than 1 for sharp images on high-DPI screens."""
_IMAGE_PATTERN = re.compile(r"!\[([^\]]*)\]\(([a-z-]+)\)")
_KEY_PATTERN = re.compile(r"\{key:([a-z_.]+)\}")
_MARKUP_PATTERN = re.compile(r"[*#|`_-]+")


@dataclass(frozen=True)
class GuidePage:
    """Page of the guide.

    Attributes:
        title: Title of the page.
        text: Contents, as Markdown.
        folders: Folders in which images are searched, in order of preference.
    """

    title: str
    text: str
    folders: tuple[Path, ...] = ()

    def matches(self, query: str) -> bool:
        """Return True if the page contains all words of a query, also in alternative texts of images."""
        text = _MARKUP_PATTERN.sub(" ", _IMAGE_PATTERN.sub(r"\1", self.text)).casefold()
        return all(word in text for word in query.casefold().split())

    @property
    def pictures(self) -> tuple[tuple[str, str], ...]:
        """Images of the page, as pairs of name and alternative text."""
        return tuple((name, alt_text) for alt_text, name in _IMAGE_PATTERN.findall(self.text))

    def picture(self, name: str, *, dark: bool) -> Path | None:
        """Return the file of an image for the dark or the light theme, or None if it doesn't exist."""
        files = (folder / ("dark" if dark else "light") / f"{name}.png" for folder in self.folders)
        return next((file for file in files if file.is_file()), None)


def read_pages(folder: Path, language: str, key_of: Callable[[str], str]) -> tuple[GuidePage, ...]:
    """Return all pages, sorted by file name. A page that isn't translated is in English.

    Args:
        folder: Folder of the guide, with one subfolder per language.
        language: Language code, such as "es".
        key_of: Returns the first shortcut of a command by name, or "".
    """
    pages = []
    language_folder = folder / language.split("-", maxsplit=1)[0].split("_", maxsplit=1)[0]
    for path in sorted((folder / ENGLISH).glob("*.md")):
        translated_path = language_folder / path.name
        text = read_regular_file(translated_path if translated_path.is_file() else path).decode("utf-8")
        text = _KEY_PATTERN.sub(lambda found: f"**{shortcut_text(key_of(found[1])) or '-'}**", text)
        title = text.partition("\n")[0].lstrip("# ")
        pages.append(GuidePage(title, text, (language_folder, folder / ENGLISH)))
    return tuple(pages)


class PageView(QTextBrowser):
    """View of a page; images are scaled to the available width."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self._page = GuidePage("", "")
        self._fitted_width = 0
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setProperty("bare", "true")
        self.setOpenLinks(False)
        self.setAccessibleName(_("Page"))
        self._fit_timer = QTimer(self)
        self._fit_timer.setSingleShot(True)
        self._fit_timer.timeout.connect(self._fit_pictures)

    def show_page(self, page: GuidePage) -> None:
        """Show a page and scroll to its start."""
        self._page = page
        self.setMarkdown(page.text)
        self.setAccessibleDescription(" ".join(alt_text for _name, alt_text in page.pictures))
        self._fit_pictures()

    def loadResource(self, kind: int, name: QUrl | str) -> object:
        if kind != QTextDocument.ResourceType.ImageResource.value:
            return super().loadResource(kind, name)
        path = self._page.picture(QUrl(name).toString(), dark=self._theme.is_dark)
        return QImage(str(path)) if path is not None else QImage()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._fitted_width and self._fitted_width != self._available_width():
            self._fit_timer.start(0)

    def _available_width(self) -> int:
        return self.viewport().width() - 2 * round(self.document().documentMargin())

    def _fit_pictures(self) -> None:
        # Scales each image to device pixels, so that it stays sharp.
        self._fitted_width = self._available_width()
        document, ratio = self.document(), self.devicePixelRatioF()
        cursor = QTextCursor(document)
        for position in self._image_positions():
            cursor.setPosition(position)
            cursor.setPosition(position + 1, QTextCursor.MoveMode.KeepAnchor)
            image_format = cursor.charFormat().toImageFormat()
            image = self.loadResource(
                QTextDocument.ResourceType.ImageResource.value, QUrl(image_format.name())
            )
            if not isinstance(image, QImage) or image.isNull():
                continue
            width = min(self._fitted_width, round(image.width() / IMAGE_PIXEL_RATIO))
            plain_image = image.convertToFormat(QImage.Format.Format_RGB32)
            pixels = plain_image.scaledToWidth(
                round(width * ratio), Qt.TransformationMode.SmoothTransformation
            )
            painter = QPainter(pixels)
            painter.setPen(self._theme.colour("border"))
            painter.drawRect(pixels.rect().adjusted(0, 0, -1, -1))
            painter.end()
            pixels.setDevicePixelRatio(ratio)
            document.addResource(
                QTextDocument.ResourceType.ImageResource.value, QUrl(image_format.name()), pixels
            )
            image_format.setWidth(width)
            image_format.setHeight(pixels.height() / ratio)
            image_format.setToolTip(plain.tip(str(image_format.property(QTextFormat.Property.ImageAltText))))
            cursor.setCharFormat(image_format)

    def _image_positions(self) -> list[int]:
        # Text positions of images.
        positions = []
        block = self.document().begin()
        while block.isValid():
            fragments = [each.fragment() for each in cast("Iterable[QTextBlock.iterator]", block)]
            positions += [part.position() for part in fragments if part.charFormat().isImageFormat()]
            block = block.next()
        return positions


class GuideSheet(Overlay):
    """Sheet with a search field and the list of pages on the left, and the current page on the right.

    The sheet opens at the last viewed page.
    """

    top = 64

    def __init__(self, theme: Theme, window: QWidget, pages: Callable[[], Sequence[GuidePage]]) -> None:
        # `pages` is called whenever the sheet opens, because keys may have changed.
        super().__init__(theme, window, _("Guide"))
        self._read_pages = pages
        self._pages: tuple[GuidePage, ...] = ()
        self.search = SearchField(theme, _("Search the guide"))
        self.search.textChanged.connect(self._apply_filter)
        self.search.installEventFilter(self)
        self.list = QListWidget()
        self.list.setAccessibleName(_("Pages of the guide"))
        self.list.setProperty("raised", "true")
        self.list.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.list.installEventFilter(self)
        self.list.currentRowChanged.connect(self._show_page)
        self.no_match_label = label(_("No matching pages."), "body", role="textSecondary", wrap=True)
        self.page = PageView(theme)
        self._lay_out()
        theme.changed.connect(self._restyle)

    def _lay_out(self) -> None:
        header = self.create_header(label(_("Guide"), "heading"))
        left = QVBoxLayout()
        left.setSpacing(8)
        left.addWidget(self.search)
        left.addWidget(self.no_match_label)
        left.addWidget(self.list, 1)
        sides = QHBoxLayout()
        sides.setSpacing(18)
        self._left = QWidget()
        left.setContentsMargins(0, 0, 0, 0)
        self._left.setLayout(left)
        sides.addWidget(self._left)
        sides.addWidget(self.page, 1)
        column = QVBoxLayout(self)
        column.setContentsMargins(20, 14, 20, 18)
        column.setSpacing(12)
        column.addLayout(header)
        column.addLayout(sides, 1)

    def initial_focus(self) -> QWidget:
        return self.list

    def preferred_size(self, room: QSize) -> QSize:
        scaled = self.theme.scaled
        return QSize(min(room.width(), round(scaled(WIDTH))), min(room.height(), round(scaled(HEIGHT))))

    def open(self) -> None:
        row = max(0, self.list.currentRow())
        self._pages = tuple(self._read_pages())
        self.search.clear()
        self._apply_filter("")
        self.list.setCurrentRow(row)
        super().open()

    @property
    def matching_pages(self) -> tuple[GuidePage, ...]:
        """Pages that match the search."""
        return tuple(page for page in self._pages if page.matches(self.search.text()))

    def _apply_filter(self, query: str) -> None:
        self.list.blockSignals(True)
        self.list.clear()
        self._left.setFixedWidth(round(self.theme.scaled(LIST_WIDTH)))
        for page in self.matching_pages:
            item = QListWidgetItem(page.title)
            item.setSizeHint(QSize(0, round(self.theme.scaled(self.theme.size("row", "comfortable")))))
            self.list.addItem(item)
        self.list.blockSignals(False)
        count = self.list.count()
        paint.show_when(self.no_match_label, count == 0)
        if query:
            paint.announce(self, ngettext("{count} page", "{count} pages", count).format(count=count))
        if count:
            self.list.setCurrentRow(0)
            self._show_page(0)

    def _show_page(self, row: int) -> None:
        if not 0 <= row < len(self.matching_pages):
            return
        theme, document = self.theme, self.page.document()
        palette = self.page.palette()
        palette.setColor(QPalette.ColorRole.Base, theme.colour("raised"))
        palette.setColor(QPalette.ColorRole.Text, theme.colour("text"))
        self.page.setPalette(palette)
        self.page.setStyleSheet(f"background: {theme.colour('raised').name()};")
        document.setDefaultFont(theme.font("bodyLarge"))
        document.setDocumentMargin(4)
        self.page.show_page(self.matching_pages[row])
        for frame in document.rootFrame().childFrames():
            if isinstance(frame, QTextTable):
                self._format_table(frame)
        self._format_text(document)
        query_words = self.search.text().split()
        if query_words:
            self.page.find(query_words[0])
        else:
            self.page.verticalScrollBar().setValue(0)

    def _format_text(self, document: QTextDocument) -> None:
        # Sets paragraph spacing, and makes emphasis semibold instead of italic.
        cursor = QTextCursor(document)
        block = document.begin()
        while block.isValid():
            cursor.setPosition(block.position())
            if cursor.currentTable() is None:
                block_format = block.blockFormat()
                heading_level = block_format.headingLevel()
                has_image = "\ufffc" in block.text()
                block_format.setBottomMargin(self.theme.scaled(4 if block.textList() is not None else 10))
                top_margin = 12 if heading_level > 1 else 6 if has_image else 0
                block_format.setTopMargin(self.theme.scaled(top_margin))
                # above an image the larger line height would look like a gap
                percent = 100.0 if has_image else LINE_HEIGHT_PERCENT
                block_format.setLineHeight(percent, QTextBlockFormat.LineHeightTypes.ProportionalHeight.value)
                cursor.setBlockFormat(block_format)
            for part in [each.fragment() for each in cast("Iterable[QTextBlock.iterator]", block)]:
                if part.charFormat().fontItalic():
                    strong = part.charFormat()
                    strong.setFontItalic(False)
                    strong.setFontWeight(QFont.Weight.DemiBold)
                    cursor.setPosition(part.position())
                    cursor.setPosition(part.position() + part.length(), QTextCursor.MoveMode.KeepAnchor)
                    cursor.setCharFormat(strong)
            block = block.next()

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Move the focus from the list to the search field on "/", and from there to the list on Down."""
        if event.type() == QEvent.Type.KeyPress and isinstance(event, QKeyEvent):
            if watched is self.list and event.text() == "/":
                self.search.setFocus(Qt.FocusReason.ShortcutFocusReason)
                return True
            if watched is self.search and event.key() == Qt.Key.Key_Down:
                self.list.setFocus(Qt.FocusReason.ShortcutFocusReason)
                return True
        return super().eventFilter(watched, event)

    def _format_table(self, table: QTextTable) -> None:
        # Sets row lines, cell padding and full width of tables.
        table_format = table.format().toTableFormat()
        table_format.setBorderStyle(QTextFrameFormat.BorderStyle.BorderStyle_Solid)
        table_format.setBorderBrush(self.theme.colour("border"))
        table_format.setBorderCollapse(True)
        table_format.setBorder(1)
        table_format.setCellPadding(7)
        table.setFormat(table_format)

    def _restyle(self) -> None:
        if self.isVisible():
            self._apply_filter(self.search.text())
