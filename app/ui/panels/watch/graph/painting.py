"""Painting of a graph scene, on the screen or into a file."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPen

from app.core.graph.walk import GraphSelection
from app.ui.panels.watch.graph.scene import (
    BRIDGE_END_WIDTH,
    LABEL_PADDING,
    GraphScene,
    GroupItem,
    LineItem,
    NodeItem,
)
from app.ui.panels.watch.graph.texts import group_note, node_icon, percent_text, quiet_text
from app.ui.theme.icons import paint_icon
from app.ui.widgets import paint

SELECTION_WIDTH = 2.25
DIM_OPACITY = 0.3
MIN_TEXT_PX = 6.0
"""Font height in px below which text is not painted, because it would be illegible."""


def paint_scene(
    scene: GraphScene,
    painter: QPainter,
    clip: QRectF,
    scale: float,
    selection: GraphSelection | None = None,
    *,
    has_focus_rings: bool = False,
) -> None:
    """Paint a part of the scene.

    Args:
        scene: Scene to paint.
        painter: Painter, which is transformed to scene coordinates.
        clip: Part to paint, in scene coordinates.
        scale: Scale of the painter, which determines the level of detail.
        selection: Selected item to highlight.
        has_focus_rings: True to paint focus rings, for use by keyboard.
    """
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    _ScenePainter(scene, painter, clip, scale, selection, has_focus_rings=has_focus_rings).paint()


class _ScenePainter:
    """Single pass that paints the visible part of a scene."""

    def __init__(
        self,
        scene: GraphScene,
        painter: QPainter,
        clip: QRectF,
        scale: float,
        selection: GraphSelection | None,
        *,
        has_focus_rings: bool,
    ) -> None:
        self.scene, self.theme, self.painter = scene, scene.theme, painter
        self.clip, self.scale, self.has_focus_rings = clip, scale, has_focus_rings
        self.has_text = scale * scene.name_font.pixelSize() >= MIN_TEXT_PX
        self.has_small_text = scene.has_small_text(scale)
        self.is_tiny = not scene.has_stats(scale)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing, not self.is_tiny)
        line = (
            scene.graph.line_of(selection.key)
            if selection is not None and selection.kind == "topic"
            else None
        )
        self.line = line
        self.selected_key = selection.key if selection is not None and selection.kind == "node" else ""
        self.line_ends = {*line.sources, *line.targets} if line is not None else set[str]()

    def paint(self) -> None:
        # Back to front: groups, lines, their labels, nodes.
        painter, clip = self.painter, self.clip
        for group in self.scene.groups:
            if group.rect.intersects(clip):
                self._paint_group(group)
        visible_lines = [item for item in self.scene.lines if item.bounds.intersects(clip)]
        above = [item for item in visible_lines if item.line is self.line]
        for item in [*(each for each in visible_lines if each.line is not self.line), *above]:
            painter.setOpacity(DIM_OPACITY if item.is_dim else 1.0)
            self._paint_line(item)
        if self.has_small_text:
            for item in self.scene.lines:
                if item.label is not None and item.label.intersects(clip):
                    painter.setOpacity(DIM_OPACITY if item.is_dim else 1.0)
                    self._paint_label(item, item.label)
        for box in self.scene.nodes.values():
            if box.rect.adjusted(-6, -6, 6, 6).intersects(clip):
                painter.setOpacity(DIM_OPACITY if box.is_dim else 1.0)
                self._paint_node(box)
        painter.setOpacity(1.0)
        for item in above:
            self._paint_losses(item)

    def _paint_group(self, item: GroupItem) -> None:
        theme, painter, group = self.theme, self.painter, item.group
        paint.box(painter, item.rect, theme.radius("card"), theme.colour("window"), theme.colour("border"))
        if not self.has_text:
            return
        header_height = self.scene.sizes.header
        side = theme.scaled(16)
        left = item.rect.left() + 14
        middle = item.rect.top() + header_height / 2
        paint_icon(
            painter, QRectF(left, middle - side / 2, side, side), group.icon, theme.colour("textSecondary")
        )
        left += side + 8
        area = QRectF(left, item.rect.top(), item.rect.right() - 10 - left, header_height)
        _paint_text(painter, area, item.name, self.scene.title_font, theme.colour("text"))
        name_width = paint.width_of(self.scene.title_font, item.name) + 8
        if area.width() - name_width > 40:
            area.setLeft(left + name_width)
            paint.text_line(
                painter, area, group_note(group), self.scene.small_font, theme.colour("textTertiary")
            )
        if item.quiet_rect is not None:
            pen = QPen(theme.colour("controlBorder"), 1, Qt.PenStyle.DashLine)
            painter.setPen(pen)
            painter.setBrush(theme.colour("panel"))
            radius = item.quiet_rect.height() / 2
            painter.drawRoundedRect(item.quiet_rect, radius, radius)
            paint.text_line(
                painter,
                item.quiet_rect,
                quiet_text(group),
                self.scene.small_font,
                theme.colour("textSecondary"),
                paint.CENTRE,
            )

    def _paint_line(self, item: LineItem) -> None:
        is_selected = item.line is self.line
        colour = self.theme.colour("accent" if is_selected else "controlBorder")
        width = 1.0 if self.is_tiny else SELECTION_WIDTH if is_selected else item.stats.width
        pen = QPen(colour, width)
        pen.setCosmetic(self.is_tiny)
        if item.line.kind == "service":
            pen.setDashPattern([5 / width, 4 / width])
        self.painter.setPen(pen)
        self.painter.setBrush(Qt.BrushStyle.NoBrush)
        if self.is_tiny:
            for polyline in item.sharp_routes():
                self.painter.drawPolyline(polyline)
            return
        self.painter.drawPath(item.path())
        self.painter.setPen(Qt.PenStyle.NoPen)
        self.painter.setBrush(colour)
        for arrow in item.arrows():
            self.painter.drawPolygon(arrow)

    def _paint_label(self, item: LineItem, rect: QRectF) -> None:
        theme, painter = self.theme, self.painter
        names, _space, rate = item.stats.label.rpartition(" ")
        if not names or not rate.endswith(("/s", "/min")):
            names, rate = item.stats.label, ""
        is_selected = item.line is self.line
        if is_selected:
            paint.box(
                painter,
                rect.adjusted(-2, -1, 2, 1),
                theme.radius("chip"),
                theme.colour("accentTint"),
                theme.colour("accent"),
            )
        elif (background := self.scene.label_background(item)) is not None:
            is_in_group = any(group.rect.contains(rect.center()) for group in self.scene.groups)
            painter.fillRect(background, theme.colour("window" if is_in_group else "panel"))
        rect = rect.adjusted(LABEL_PADDING, 0, -LABEL_PADDING, 0)
        colour = theme.colour("accentText" if is_selected else "text")
        _paint_text(painter, rect, names, self.scene.label_font, colour)
        if rate:
            names_width = (len(names) + 1) * self.scene.char_width
            area = rect.adjusted(names_width, 0, 20, 0)
            quiet = theme.colour("accentText" if is_selected else "textSecondary")
            _paint_text(painter, area, rate, self.scene.label_font, quiet)

    def _paint_losses(self, item: LineItem) -> None:
        if not self.has_small_text:
            return
        theme, painter, font = self.theme, self.painter, self.scene.small_font
        for box, ratio in item.stats.losses:
            tip = next((points[-1] for ends, points in item.routes.items() if ends[1] == box), None)
            if tip is None:
                continue
            text = percent_text(ratio)
            side = theme.scaled(12)
            width, height = paint.width_of(font, text) + side + 18, theme.scaled(20)
            chip = QRectF(tip[0] - width - 12, tip[1] + 6, width, height)
            paint.box(painter, chip, height / 2, theme.colour("warnTint"), theme.colour("warnBorder"))
            icon_rect = QRectF(chip.left() + 7, chip.center().y() - side / 2, side, side)
            paint_icon(painter, icon_rect, "triangle-alert", theme.colour("warn"))
            _paint_text(painter, chip.adjusted(side + 11, 0, 0, 0), text, font, theme.colour("warn"))

    def _paint_node(self, item: NodeItem) -> None:
        theme, painter, node = self.theme, self.painter, item.node
        is_selected = node.key == self.selected_key
        is_line_end = node.key in self.line_ends
        is_source = self.line is not None and node.key in self.line.sources
        fill = theme.colour("selected" if is_selected or is_source else "panel")
        edge = theme.colour("accent" if is_selected or is_line_end else "controlBorder")
        radius = theme.radius("panel")
        is_faint = node.is_gone or node.is_quiet
        if is_faint:
            painter.setPen(QPen(edge, 1, Qt.PenStyle.DashLine))
            painter.setBrush(fill)
            painter.drawRoundedRect(item.rect.adjusted(0.5, 0.5, -0.5, -0.5), radius, radius)
        else:
            paint.box(painter, item.rect, radius, fill, edge, 1.5 if is_selected or is_line_end else 1.0)
        if node.bridged_network:
            self._paint_bridge_end(item.rect, node.bridged_network, edge)
        if is_selected and self.has_focus_rings:
            ring = item.rect.adjusted(-3, -3, 3, 3)
            paint.box(painter, ring, radius + 3, None, theme.colour("focus"), 2.0)
        if self.has_text:
            self._paint_texts(
                item, "textDisabled" if node.is_gone else "textSecondary" if is_faint else "text"
            )

    def _paint_bridge_end(self, rect: QRectF, network: str, edge: QColor) -> None:
        # Right part of a bridge, with the name of the other network.
        theme, painter = self.theme, self.painter
        part = QRectF(
            rect.right() - BRIDGE_END_WIDTH, rect.top() + 1, BRIDGE_END_WIDTH - 1, rect.height() - 2
        )
        paint.box(painter, part, theme.radius("small"), theme.colour("sunken"))
        painter.setPen(QPen(edge, 1))
        painter.drawLine(part.topLeft(), part.bottomLeft())
        if self.has_small_text:
            font = QFont(self.scene.small_font)
            font.setWeight(QFont.Weight.DemiBold)
            paint.text_line(painter, part, network, font, theme.colour("textSecondary"), paint.CENTRE)

    def _paint_texts(self, item: NodeItem, role: str) -> None:
        theme, painter, rect = self.theme, self.painter, item.rect
        side = theme.scaled(16)
        icon_rect = QRectF(rect.left() + 12, rect.center().y() - side / 2, side, side)
        quiet = theme.colour("textDisabled" if item.node.is_gone else "textSecondary")
        paint_icon(painter, icon_rect, node_icon(item.node), quiet)
        left = rect.left() + 12 + side + 10
        has_detail = self.has_small_text and bool(item.elided_detail)
        area = QRectF(left, rect.top(), rect.right() - 4 - left, rect.height())
        if has_detail:
            area.adjust(0, 5, 0, 1 - rect.height() / 2)
        font = self.scene.name_font
        if item.node.is_gone:
            font = QFont(font)
            font.setStrikeOut(True)
        _paint_text(painter, area, item.name, font, theme.colour(role))
        if has_detail:
            area.translate(0, rect.height() / 2 - 4)
            _paint_text(
                painter, area, item.elided_detail, self.scene.small_font, theme.colour("textTertiary")
            )


def _paint_text(painter: QPainter, rect: QRectF, text: str, font: QFont, colour: QColor) -> None:
    # Faster than `paint.text_line`, which measures the text again.
    painter.setFont(font)
    painter.setPen(colour)
    painter.drawText(rect, int(paint.LEFT), text)
