"""Lucide icons, painted in the colour of the adjacent text and sharp at every device pixel ratio.

There is one drawing per icon for all themes, in which ``currentColor`` is replaced when it is painted.
Delegates and painted widgets call `paint_icon`; other widgets use a QIcon with an `IconEngine`.
"""

from __future__ import annotations

import difflib
import logging
from collections.abc import Callable
from functools import lru_cache

from PySide6.QtCore import QByteArray, QPointF, QRect, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QIcon, QIconEngine, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

from app import resources
from app.ui.overrides import guard

MIN_THIN_SIZE_PX = 20
DOT_SIZE_RATIO = 10 / 16
FALLBACK_ICON = "circle-question-mark"
SVG_START_TAG = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="24" height="24" viewBox="0 0 24 24" fill="none"'
    ' stroke="currentColor" stroke-width="2" stroke-linecap="round" stroke-linejoin="round">'
)

_log = logging.getLogger("studio")


@lru_cache(maxsize=1)
def _shapes() -> dict[str, str]:
    # The contents of each icon's <svg> by name: all of Lucide, because a robot may name any of them.
    text = resources.path("icons", "lucide.txt").read_text("utf-8")
    return dict(line.split("\t", 1) for line in text.splitlines())


def names() -> frozenset[str]:
    """Return the names of all icons."""
    return frozenset(_shapes())


@lru_cache(maxsize=256)
def _source(name: str) -> str:
    shape = _shapes().get(name)
    if shape is None:
        _log.warning("unknown icon '%s'%s; using a placeholder", name[:80], _suggestion(name))
        shape = _shapes()[FALLBACK_ICON]
    return f"{SVG_START_TAG}{shape}</svg>"


def _suggestion(name: str) -> str:
    matches = difflib.get_close_matches(name[:80], names(), 1)
    return f" (did you mean '{matches[0]}'?)" if matches else ""


def icon_svg(name: str, colour: str, size_px: float = 0) -> str:
    """Return an icon as SVG.

    Args:
        name: Name of the icon.
        colour: Colour of the lines, as ``#RRGGBB``.
        size_px: Displayed size, which determines the width of the lines.
    """
    text = _source(name).replace("currentColor", colour)
    return text if size_px < MIN_THIN_SIZE_PX else text.replace('stroke-width="2"', 'stroke-width="1.75"')


@lru_cache(maxsize=512)
def _renderer(name: str, colour: str, opacity: float, is_filled: bool, is_thin: bool) -> QSvgRenderer:
    text = icon_svg(name, colour, MIN_THIN_SIZE_PX if is_thin else 0)
    if is_filled:
        text = text.replace('fill="none"', f'fill="{colour}"', 1)
    if opacity < 1:
        text = text.replace("<svg", f'<svg opacity="{opacity:.3f}"', 1)
    return QSvgRenderer(QByteArray(text.encode("utf-8")))


def paint_icon(
    painter: QPainter, rect: QRectF, name: str, colour: QColor, *, is_filled: bool = False
) -> None:
    """Paint an icon into a square.

    Args:
        painter: Painter.
        rect: Square in logical pixels.
        name: Name of the icon, or "dot" for a filled disc. An unknown name is logged with a suggestion
            and replaced by a question mark.
        colour: Colour of the lines.
        is_filled: True to fill the shape with the colour.
    """
    painter.save()
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    if name == "dot":
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colour)
        radius = min(rect.width(), rect.height()) * DOT_SIZE_RATIO / 2
        painter.drawEllipse(rect.center(), radius, radius)
    else:
        is_thin = rect.width() >= MIN_THIN_SIZE_PX
        _renderer(name, colour.name(), round(colour.alphaF(), 3), is_filled, is_thin).render(painter, rect)
    painter.restore()


@lru_cache(maxsize=512)
def _cached_pixmap(
    name: str,
    width: float,
    height: float,
    rgba: int,
    ratio: float,
    *,
    is_filled: bool = False,
    is_right: bool = False,
) -> QPixmap:
    pixmap = QPixmap(round(width * ratio), round(height * ratio))
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    icon_rect = _square_in(QRectF(0, 0, width, height), is_right)
    paint_icon(painter, icon_rect, name, QColor.fromRgba(rgba), is_filled=is_filled)
    painter.end()
    return pixmap


def _square_in(rect: QRectF, is_right: bool) -> QRectF:
    # A wider rectangle has space for the gap between the icon and a text.
    side = min(rect.width(), rect.height())
    square = QRectF(rect.left(), rect.center().y() - side / 2, side, side)
    if is_right:
        square.moveRight(rect.right())
    return square


def paint_cached_icon(painter: QPainter, rect: QRectF, name: str, colour: QColor) -> None:
    """Paint an icon from a cached pixmap, aligned to device pixels.

    Faster than `paint_icon`, for widgets that are repainted often.
    """
    ratio = painter.device().devicePixelRatioF()
    position = QPointF(round(rect.x() * ratio) / ratio, round(rect.y() * ratio) / ratio)
    painter.drawPixmap(position, _cached_pixmap(name, rect.width(), rect.width(), colour.rgba(), ratio))


@guard  # not a QObject
class IconEngine(QIconEngine):
    """Icon engine that paints an icon in the colour of the current mode, such as normal or disabled.

    In a size that is wider than high, the icon is on the left or on the right.
    """

    def __init__(
        self,
        name: str,
        colour: Callable[[QIcon.Mode, QIcon.State], QColor],
        *,
        is_filled: bool = False,
        is_right: bool = False,
    ) -> None:
        # `colour` is called at each paint, so that a new theme needs no new icon.
        super().__init__()
        _source(name)
        self._name = name
        self._colour = colour
        self._is_filled, self._is_right = is_filled, is_right

    def paint(self, painter: QPainter, rect: QRect, mode: QIcon.Mode, state: QIcon.State) -> None:
        icon_rect, colour = _square_in(QRectF(rect), self._is_right), self._colour(mode, state)
        paint_icon(painter, icon_rect, self._name, colour, is_filled=self._is_filled)

    def pixmap(self, size: QSize, mode: QIcon.Mode, state: QIcon.State) -> QPixmap:
        return self.scaledPixmap(size, mode, state, 1.0)

    def scaledPixmap(self, size: QSize, mode: QIcon.Mode, state: QIcon.State, scale: float) -> QPixmap:
        width, height, rgba = size.width(), size.height(), self._colour(mode, state).rgba()
        return _cached_pixmap(
            self._name, width, height, rgba, scale, is_filled=self._is_filled, is_right=self._is_right
        )

    def key(self) -> str:
        return f"nep:{self._name}"

    def clone(self) -> QIconEngine:
        return IconEngine(self._name, self._colour, is_filled=self._is_filled, is_right=self._is_right)
