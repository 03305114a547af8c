"""Canvas of the graph: pan, zoom and selection by mouse and keys."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QEvent, QPoint, QPointF, QRectF, QSize, QSizeF, Qt, Signal
from PySide6.QtGui import (
    QContextMenuEvent,
    QFocusEvent,
    QHelpEvent,
    QKeyEvent,
    QMouseEvent,
    QNativeGestureEvent,
    QPainter,
    QPaintEvent,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QSizePolicy, QToolTip, QWidget

from app.core.graph.walk import Arrow, GraphSelection, move_selection
from app.ui.panels.watch.graph.painting import paint_scene
from app.ui.panels.watch.graph.scene import GraphScene, LineItem, NodeItem, StatsGetter
from app.ui.text import plain
from app.ui.theme.theme import Theme
from app.ui.widgets import paint
from app.ui.widgets.keyboard import has_no_modifiers, is_keyboard_navigation
from nep.i18n import _

MIN_SCALE, MAX_SCALE = 0.05, 3.0
ZOOM_STEP = 1.2
MARGIN = 20.0
PAN_STEP = 60.0
CLICK_TOLERANCE = 4.0
"""Maximum mouse movement in px for which a press still counts as a click."""
MAX_UPDATES_PER_TICK = 250
"""Maximum number of nodes and lines updated per tick."""
MAX_DIRTY_RECTS = 60
"""Number of changed areas above which the whole canvas is repainted instead."""
_ARROW_KEYS: dict[int, Arrow] = {
    Qt.Key.Key_Left: "left",
    Qt.Key.Key_Right: "right",
    Qt.Key.Key_Up: "up",
    Qt.Key.Key_Down: "down",
}
_PAN_DIRECTIONS = {"left": (1, 0), "right": (-1, 0), "up": (0, 1), "down": (0, -1)}
PANEL_KEYS = {Qt.Key.Key_G: "g", Qt.Key.Key_H: "h", Qt.Key.Key_S: "s", Qt.Key.Key_Slash: "/"}


class GraphCanvas(QWidget):
    """Canvas that shows a scene and handles pan, zoom and selection.

    The viewport stays the same when the scene changes, unless the whole graph is fitted into the view.

    Signals:
        selected: New selection, or None.
        opened: Key of a topic to inspect.
        card_focus_requested: The card of the selected node should get the focus.
        toggled: Key of a group to expand or collapse.
        quiet_nodes_requested: Key of a group whose quiet nodes should be shown.
        key_pressed: Key for the panel to handle, such as "g".
        viewport_changed: The viewport changed.
        menu_requested: Item and screen position for a context menu.

    Args:
        describe: Returns the selection as text for screen readers.
        tip: Returns the tooltip of a topic.
    """

    selected = Signal(object)
    opened = Signal(str)
    card_focus_requested = Signal()
    toggled = Signal(str)
    quiet_nodes_requested = Signal(str)
    key_pressed = Signal(str)
    viewport_changed = Signal()
    menu_requested = Signal(object, QPoint)

    def __init__(
        self, theme: Theme, describe: Callable[[GraphSelection | None], str], tip: Callable[[str], str]
    ) -> None:
        super().__init__()
        self._theme, self._describe, self._tip = theme, describe, tip
        self.scene: GraphScene | None = None
        self.selection: GraphSelection | None = None
        self.scale = 1.0
        self._offset = QPointF()
        self._shows_all = True
        self._pending_items: list[NodeItem | LineItem] = []
        self._press_position: QPointF | None = None
        self._is_dragged = False
        self.paint_count = 0
        """Number of paint events, for tests and benchmarks."""
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setProperty("ownFocus", "true")
        self.setMouseTracking(True)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setAccessibleName(_("Graph of nodes"))
        theme.changed.connect(self.update)
        self.viewport_changed.connect(self.schedule_update)

    def sizeHint(self) -> QSize:
        return QSize(640, 420)

    def minimumSizeHint(self) -> QSize:
        return QSize(120, 80)

    # -- display ------------------------------------------------------------------------------------------

    def show_scene(self, scene: GraphScene | None) -> None:
        """Replace the scene; None shows an empty canvas.

        The selection is cleared if the new scene does not contain the selected item.
        """
        self.scene = scene
        if self.selection is not None and not self._exists(self.selection):
            self.select(None)
        elif self.selection is not None:
            self.setAccessibleDescription(self._describe(self.selection))
        if self._shows_all:
            self.show_all()
        self.update()
        self.viewport_changed.emit()

    def _exists(self, selection: GraphSelection) -> bool:
        if self.scene is None:
            return False
        graph = self.scene.graph
        return (
            graph.node(selection.key) if selection.kind == "node" else graph.line_of(selection.key)
        ) is not None

    def schedule_update(self) -> None:
        """Schedule a refresh of the rates and counts on visible items; `update_stats` performs it."""
        if self.scene is not None:
            self._pending_items = self.scene.items_in(self.visible_rect())

    def update_stats(self, stats_of: StatsGetter) -> int:
        """Update the rates and counts of the next visible items, at most `MAX_UPDATES_PER_TICK`.

        This is called on every tick; the work is divided, because each call must be short. Only changed
        areas are repainted.

        Args:
            stats_of: Returns label, width and losses of a line.

        Returns:
            The number of changed areas that are visible; 0 if the zoom is too small for rates and counts.
        """
        scene = self.scene
        if scene is None or not self._pending_items:
            return 0
        if not scene.has_stats(self.scale):
            self._pending_items = []  # updated when the user zooms in
            return 0
        batch, self._pending_items = (
            self._pending_items[:MAX_UPDATES_PER_TICK],
            self._pending_items[MAX_UPDATES_PER_TICK:],
        )
        has_small_text = scene.has_small_text(self.scale)
        changed = [scene.update_stats(item, stats_of, with_small_text=has_small_text) for item in batch]
        visible_area = self.visible_rect()
        areas = [area for area in changed if area is not None and area.intersects(visible_area)]
        if len(areas) > MAX_DIRTY_RECTS:
            self.update()
        else:
            for area in areas:
                self.update(self._to_screen(area).adjusted(-2, -2, 2, 2).toAlignedRect())
        return len(areas)

    def select(self, selection: GraphSelection | None, *, by_key: bool = False) -> None:
        """Select an item.

        Args:
            selection: Item to select; None clears the selection.
            by_key: True if the user pressed a key: the item is scrolled into view and announced to screen
                readers.
        """
        if selection == self.selection:
            return
        self.selection = selection
        description = self._describe(selection)
        self.setAccessibleDescription(description)
        if by_key:
            self._scroll_to_selection()
            paint.announce(self, description)
        self.update()
        self.selected.emit(selection)

    # -- viewport -----------------------------------------------------------------------------------------

    def visible_rect(self) -> QRectF:
        """Return the visible part of the scene, in scene coordinates."""
        left_top = -self._offset / self.scale
        return QRectF(left_top.x(), left_top.y(), self.width() / self.scale, self.height() / self.scale)

    def show_all(self) -> None:
        """Fit the whole graph into the view, at a scale of at most 100 %.

        The graph stays fitted when the canvas is resized, until the next pan or zoom.
        """
        self._shows_all = True
        if self.scene is None or self.scene.bounds.isEmpty():
            return
        bounds = self.scene.bounds.adjusted(-MARGIN, -MARGIN, MARGIN, MARGIN)
        fit_scale = min(self.width() / bounds.width(), self.height() / bounds.height(), 1.0)
        self.scale = max(MIN_SCALE, fit_scale)
        self._offset = QPointF(self.width() / 2, self.height() / 2) - bounds.center() * self.scale
        self.update()
        self.viewport_changed.emit()

    def zoom_by(self, factor: float, position: QPointF | None = None) -> None:
        """Zoom by a factor around a point of the widget, by default its centre."""
        self.zoom_to(self.scale * factor, position)

    def zoom_to(self, scale: float, position: QPointF | None = None) -> None:
        """Zoom to a scale (1.0 is 100 %) around a point of the widget, by default its centre."""
        position = position if position is not None else QPointF(self.width() / 2, self.height() / 2)
        scale = min(MAX_SCALE, max(MIN_SCALE, scale))
        self._offset = position - (position - self._offset) * (scale / self.scale)
        self.scale = scale
        self._shows_all = False
        self.update()
        self.viewport_changed.emit()

    def move_by(self, dx: float, dy: float) -> None:
        """Pan by a distance in px."""
        self._offset += QPointF(dx, dy)
        self._shows_all = False
        self.update()
        self.viewport_changed.emit()

    def center_on(self, point: QPointF) -> None:
        """Centre the view on a point of the scene."""
        middle = self.visible_rect().center()
        self.move_by((middle.x() - point.x()) * self.scale, (middle.y() - point.y()) * self.scale)

    def _scroll_to_selection(self) -> None:
        rect = self._rect_of(self.selection)
        if not rect.isNull() and not self.visible_rect().contains(rect):
            self.center_on(rect.center())

    def _rect_of(self, selection: GraphSelection | None) -> QRectF:
        scene = self.scene
        if scene is None or selection is None:
            return QRectF()
        if selection.kind == "node":
            return scene.nodes[selection.key].rect if selection.key in scene.nodes else QRectF()
        item = next((each for each in scene.lines if selection.key in each.line.topics), None)
        if item is None:
            return QRectF()
        return item.label if item.label is not None else QRectF(item.bounds.center(), QSizeF(1, 1))

    def _to_screen(self, area: QRectF) -> QRectF:
        return QRectF(
            area.left() * self.scale + self._offset.x(),
            area.top() * self.scale + self._offset.y(),
            area.width() * self.scale,
            area.height() * self.scale,
        )

    def _to_scene(self, position: QPointF) -> QPointF:
        return (position - self._offset) / self.scale

    # -- Qt events ----------------------------------------------------------------------------------------

    def paintEvent(self, event: QPaintEvent) -> None:
        self.paint_count += 1
        painter = QPainter(self)
        theme = self._theme
        painter.fillRect(event.rect(), theme.colour("panel"))
        if self.scene is not None:
            painter.setClipRegion(event.region())
            painter.translate(self._offset)
            painter.scale(self.scale, self.scale)
            clip = QRectF(event.rect())
            corner = self._to_scene(clip.topLeft())
            visible_area = QRectF(corner, clip.size() / self.scale)
            has_focus_rings = self.hasFocus() and is_keyboard_navigation()
            paint_scene(
                self.scene, painter, visible_area, self.scale, self.selection, has_focus_rings=has_focus_rings
            )
            painter.resetTransform()
        if self.hasFocus() and is_keyboard_navigation() and self.selection is None:
            focus_rect = QRectF(self.rect()).adjusted(2, 2, -2, -2)
            paint.box(painter, focus_rect, theme.radius("small"), None, theme.colour("focus"), 2.0)
        painter.end()

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        if self._shows_all:
            self.show_all()
        else:
            self.viewport_changed.emit()

    def focusInEvent(self, event: QFocusEvent) -> None:
        super().focusInEvent(event)
        self.update()

    def focusOutEvent(self, event: QFocusEvent) -> None:
        super().focusOutEvent(event)
        self.update()

    def event(self, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ToolTip and isinstance(event, QHelpEvent):
            self._show_tip(event)
            return True
        if isinstance(event, QNativeGestureEvent):
            if event.gestureType() == Qt.NativeGestureType.ZoomNativeGesture:
                self.zoom_by(1 + event.value(), event.position())
            return True
        return super().event(event)

    def _show_tip(self, event: QHelpEvent) -> None:
        text = ""
        position = self._to_scene(QPointF(event.pos()))
        if self.scene is not None:
            node = self.scene.node_at(position)
            item = self.scene.line_at(position, self.scale) if node is None else None
            if node is not None:
                text = self._describe(GraphSelection("node", node.key))
            elif item is not None:
                text = "\n".join(self._tip(topic) for topic in item.line.topics[:12])
        QToolTip.showText(event.globalPos(), plain.tip(text), self)

    def wheelEvent(self, event: QWheelEvent) -> None:
        if event.modifiers() & Qt.KeyboardModifier.ShiftModifier or not event.pixelDelta().isNull():
            delta = event.pixelDelta() if not event.pixelDelta().isNull() else event.angleDelta()
            if not event.modifiers() & Qt.KeyboardModifier.ControlModifier:
                is_horizontal = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier) and not delta.x()
                self.move_by(delta.y() if is_horizontal else delta.x(), 0 if is_horizontal else delta.y())
                event.accept()
                return
        self.zoom_by(ZOOM_STEP ** (event.angleDelta().y() / 120), event.position())
        event.accept()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        if event.button() in {Qt.MouseButton.LeftButton, Qt.MouseButton.MiddleButton}:
            self._press_position, self._is_dragged = event.position(), False

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._press_position is not None:
            delta = event.position() - self._press_position
            if self._is_dragged or delta.manhattanLength() > CLICK_TOLERANCE:
                self._is_dragged = True
                self.move_by(delta.x(), delta.y())
                self._press_position = event.position()
                self.setCursor(Qt.CursorShape.ClosedHandCursor)
            return
        self.setCursor(
            Qt.CursorShape.PointingHandCursor
            if self._item_at(event.position()) is not None
            else Qt.CursorShape.ArrowCursor
        )

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        is_click = self._press_position is not None and not self._is_dragged
        self._press_position, self._is_dragged = None, False
        if is_click and event.button() == Qt.MouseButton.LeftButton:
            self._click_at(event.position())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        target = self._item_at(event.position())
        if isinstance(target, GraphSelection) and target.kind == "topic":
            self.opened.emit(target.key)

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        # Selects the item under the mouse first, so that its card fits the menu.
        if event.reason() == QContextMenuEvent.Reason.Keyboard:
            selection, position = self.selection, self._to_screen(self._rect_of(self.selection)).center()
        else:
            target, position = self._item_at(QPointF(event.pos())), QPointF(event.pos())
            selection = target if isinstance(target, GraphSelection) else None
            if selection is not None:
                self.select(selection)
        if selection is not None:
            self.menu_requested.emit(selection, self.mapToGlobal(position.toPoint()))

    def _click_at(self, position: QPointF) -> None:
        target = self._item_at(position)
        if isinstance(target, tuple):
            group, is_title = target
            (self.toggled if is_title else self.quiet_nodes_requested).emit(group)
            return
        if target is not None and target.kind == "node" and self.expand_group(target.key):
            return
        self.select(target)

    def _item_at(self, position: QPointF) -> GraphSelection | tuple[str, bool] | None:
        # The bool of a group is True for its title, False for its number of quiet nodes.
        scene = self.scene
        if scene is None:
            return None
        scene_position = self._to_scene(position)
        node = scene.node_at(scene_position)
        if node is not None:
            return GraphSelection("node", node.key)
        item = scene.line_at(scene_position, self.scale)
        if item is not None:
            return GraphSelection("topic", item.line.topics[0], item.line.sources[0])
        group = scene.group_at(scene_position)
        return (group[0].key, group[1]) if group is not None else None

    def expand_group(self, key: str) -> bool:
        """Expand a collapsed group.

        Args:
            key: Key of a node.

        Returns:
            False if the node is not a collapsed group.
        """
        node = self.scene.graph.node(key) if self.scene is not None else None
        if node is None or node.kind != "group":
            return False
        (self.quiet_nodes_requested if node.quiet_count == node.member_count else self.toggled).emit(
            node.group
        )
        return True

    # -- keys ---------------------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        key = event.key()
        arrow = _ARROW_KEYS.get(key)
        if arrow is not None and event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            dx, dy = _PAN_DIRECTIONS[arrow]
            self.move_by(dx * PAN_STEP, dy * PAN_STEP)
        elif arrow is not None and has_no_modifiers(event):
            self._select_neighbour(arrow)
        elif key in {Qt.Key.Key_Return, Qt.Key.Key_Enter} and has_no_modifiers(event):
            self._activate()
        elif key == Qt.Key.Key_Escape and self.selection is not None:
            self.select(None)
        elif not self._handle_zoom_key(event):
            super().keyPressEvent(event)

    def _handle_zoom_key(self, event: QKeyEvent) -> bool:
        modifiers = event.modifiers() & ~(
            Qt.KeyboardModifier.ShiftModifier | Qt.KeyboardModifier.KeypadModifier
        )
        key = event.key()
        if modifiers:
            return False
        if key in PANEL_KEYS:
            self.key_pressed.emit(PANEL_KEYS[Qt.Key(key)])
        elif event.text() in {"+", "="}:
            self.zoom_by(ZOOM_STEP)
        elif event.text() == "-":
            self.zoom_by(1 / ZOOM_STEP)
        elif event.text() == "0":
            self.show_all()
        else:
            return False
        return True

    def _select_neighbour(self, arrow: Arrow) -> None:
        if self.scene is not None:
            neighbour = move_selection(self.scene.graph, self.scene.layout, self.selection, arrow)
            if neighbour is not None:
                self.select(neighbour, by_key=True)

    def _activate(self) -> None:
        selection = self.selection
        if selection is None:
            return
        if selection.kind == "topic":
            self.opened.emit(selection.key)
        elif not self.expand_group(selection.key):
            self.card_focus_requested.emit()


class GraphOverview(QWidget):
    """Small map of the whole graph with a frame around the visible part; a click centres the view there."""

    def __init__(self, theme: Theme, canvas: GraphCanvas) -> None:
        super().__init__(canvas)
        self._theme, self._canvas = theme, canvas
        self.resize(168, 104)
        self.setAccessibleName(_("Overview"))
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        canvas.viewport_changed.connect(self._update_position)
        self.hide()

    def _update_position(self) -> None:
        # Visible while part of the graph is out of view and there is room for it.
        canvas, scene = self._canvas, self._canvas.scene
        is_needed = (
            scene is not None
            and not canvas.visible_rect().contains(scene.bounds)
            and canvas.width() > 3 * self.width()
            and canvas.height() > 3 * self.height()
        )
        self.move(canvas.width() - self.width() - 12, canvas.height() - self.height() - 12)
        self.setVisible(is_needed)
        self.update()

    def _fit_transform(self, scene: GraphScene) -> tuple[float, QPointF]:
        bounds = scene.bounds.adjusted(-MARGIN, -MARGIN, MARGIN, MARGIN)
        scale = min((self.width() - 8) / bounds.width(), (self.height() - 8) / bounds.height())
        return scale, QPointF(self.width() / 2, self.height() / 2) - bounds.center() * scale

    def paintEvent(self, _event: QPaintEvent) -> None:
        scene, theme = self._canvas.scene, self._theme
        painter = QPainter(self)
        rect = QRectF(self.rect())
        paint.box(painter, rect, theme.radius("panel"), theme.colour("panel"), theme.colour("borderStrong"))
        if scene is not None:
            scale, offset = self._fit_transform(scene)
            painter.save()
            painter.translate(offset)
            painter.scale(scale, scale)
            for group in scene.groups:
                painter.fillRect(group.rect, theme.colour("sunken"))
            selection = self._canvas.selection
            for key, item in scene.nodes.items():
                is_selected = selection is not None and selection.key == key
                painter.fillRect(item.rect, theme.colour("accent" if is_selected else "controlBorder"))
            painter.restore()
            visible_area = self._canvas.visible_rect()
            frame = QRectF(visible_area.topLeft() * scale + offset, visible_area.size() * scale)
            paint.box(
                painter, frame.intersected(rect.adjusted(2, 2, -2, -2)), 3, None, theme.colour("accent"), 1.5
            )
        painter.end()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        scene = self._canvas.scene
        if scene is not None and event.button() == Qt.MouseButton.LeftButton:
            scale, offset = self._fit_transform(scene)
            self._canvas.center_on((event.position() - offset) / scale)
