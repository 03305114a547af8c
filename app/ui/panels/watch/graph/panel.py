"""Graph panel: nodes in groups, with topics and services as lines between them."""

from __future__ import annotations

import math
import platform
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from PySide6.QtCore import QBuffer, QIODevice, QPoint, QRectF, Qt
from PySide6.QtGui import QAction, QColor, QPainter, QResizeEvent
from PySide6.QtSvg import QSvgGenerator
from PySide6.QtWidgets import QBoxLayout, QVBoxLayout, QWidget

from app.core.graph.activity import CallRates, QuietNodes
from app.core.graph.dot import format_dot
from app.core.graph.layout import GraphLayout, LayoutSizes
from app.core.graph.layout_thread import LayoutThread
from app.core.graph.node_graph import (
    MAX_EXPANDED_NODES,
    DrawnNode,
    GraphInput,
    GraphLine,
    GraphOptions,
    GroupBy,
    NodeGraph,
    is_drawn,
    node_graph,
)
from app.core.graph.walk import GraphSelection
from app.core.network.topics import split_key
from app.core.network.web_texts import page_nodes
from app.core.storage.atomic_file import write_atomically
from app.ui.intents import RecordTopic
from app.ui.panels.base import Panel, PanelContext, PanelWidget
from app.ui.panels.home import TabHome
from app.ui.panels.row_actions import (
    RowAction,
    copy_action,
    fill_menu,
    node_actions,
    service_actions,
    show_messages,
    topic_actions,
)
from app.ui.panels.watch.graph.canvas import GraphCanvas, GraphOverview
from app.ui.panels.watch.graph.card import CARD_WIDTH, CardSources, GraphCard, node_card, topic_card
from app.ui.panels.watch.graph.painting import paint_scene
from app.ui.panels.watch.graph.scene import NODE_TEXT_INSET, GraphScene
from app.ui.panels.watch.graph.texts import (
    LineStats,
    behaviour_detail,
    counts_text,
    finite_or_none,
    group_name,
    line_name,
    line_stats,
    node_detail,
    node_name,
    short_rate,
)
from app.ui.panels.watch.graph.tools import GraphLegend, GraphTools
from app.ui.text import plain
from app.ui.text.nodes import cpu_text
from app.ui.text.numbers import bandwidth_text, group_digits
from app.ui.widgets import Button, EmptyAction, EmptyState, Separator, label, paint
from app.ui.widgets.file_dialogs import FileKind
from app.ui.widgets.menus import Menu
from nep.i18n import _, lazy, ngettext

SVG_KIND = FileKind(lazy("An image that stays sharp at any size"), ".svg")
DOT_KIND = FileKind(lazy("Graph for other programs"), ".dot")
MAX_LINES_PER_TICK = 500
"""Number of lines above which a scene is painted one tick after it was built, to keep each tick short."""
MIN_SIDE_CARD_WIDTH = 700
"""Width of the panel in px (at 100 % text size) from which the card is at the side, else at the bottom."""
QUIET_UPDATE_TICKS = 30
"""Number of ticks (at 30 Hz) between checks for quiet nodes."""
MAX_MENU_TOPICS = 20
"""Maximum number of topics in the menu of a line; the cards of its nodes list more topics."""
GROUPS: tuple[GroupBy, ...] = ("computer", "robot", "nothing")


class GraphPanel(PanelWidget):
    """Panel with the graph, a toolbar above it, and the card of the selected item at the side."""

    def __init__(self, context: PanelContext) -> None:
        super().__init__(context, _("Graph"))
        theme = self.theme
        self._host = platform.node()
        self._options = GraphOptions()
        self._thread = LayoutThread()
        self._quiet, self._calls = QuietNodes(), CallRates()
        self._layout: GraphLayout | None = None
        self._pending_scene: GraphScene | None = None
        self._requested_graph: NodeGraph | None = None
        self._requested_sizes = LayoutSizes()
        self._last_snapshot: tuple[object, ...] = ()
        self._values_revisions: tuple[object, ...] = ()
        self._ticks = 0
        self._call_rates_hz: Mapping[str, float] = {}
        self._box_of: Callable[[str], str] = lambda _entry: ""
        self.count = label("", "small", role="textSecondary")
        self.export = Button(theme, _("Export"), "download", size="small")
        self._export_menu = Menu(theme, self.export)
        for text, kind in ((_("Image (SVG)"), SVG_KIND), (_("Graph (DOT)"), DOT_KIND)):
            self._export_menu.addAction(text).triggered.connect(
                lambda _on=False, kind=kind: self._prompt_file(kind)
            )
        self.export.clicked.connect(
            lambda: self._export_menu.popup(self.export.mapToGlobal(self.export.rect().bottomLeft()))
        )
        self.count.setProperty("place", "start")
        self.header = [self.count, self.export]
        self.tools = GraphTools(theme)
        self.canvas = GraphCanvas(theme, self._description_of, self._topic_description)
        self.overview = GraphOverview(theme, self.canvas)
        self.legend = GraphLegend(theme)
        self.card = GraphCard(theme)
        self.empty = EmptyState(theme, "workflow", "", "")
        self.note = label("", "small", role="textSecondary", wrap=True)
        self.note.setContentsMargins(12, 2, 12, 4)
        self.note.hide()
        self._make_actions()
        self._connect()
        self.pages = self.make_page_stack(self._make_page(), self.empty)
        self.setFocusProxy(self.canvas)
        self.theme_changed()

    def _make_actions(self) -> None:
        theme = self.theme
        self._internal_topics_action = QAction(_("Show NEP's own topics"), self)
        self._internal_topics_action.setCheckable(True)
        self._internal_topics_action.toggled.connect(lambda on: self._update_options(shows_internal=on))
        self._rearrange = QAction(theme.icon("refresh-cw"), _("Rearrange"), self)
        self._rearrange.triggered.connect(lambda _on=False: self._reset_layout())

    def _connect(self) -> None:
        tools, canvas = self.tools, self.canvas
        tools.filter.textChanged.connect(self._apply_filter)
        tools.filter.exited.connect(lambda: canvas.setFocus(Qt.FocusReason.ShortcutFocusReason))
        tools.group.changed.connect(self._group_by)
        tools.quiet.clicked.connect(
            lambda: self._update_options(
                hides_quiet=tools.quiet.isChecked(), groups_with_visible_quiet_nodes=frozenset()
            )
        )
        tools.services.clicked.connect(
            lambda: self._update_options(shows_services=tools.services.isChecked())
        )
        tools.show_all_button.clicked.connect(canvas.show_all)
        tools.zoom_in.clicked.connect(lambda: canvas.zoom_by(1.2))
        tools.zoom_out.clicked.connect(lambda: canvas.zoom_by(1 / 1.2))
        canvas.viewport_changed.connect(lambda: tools.show_scale(canvas.scale))
        canvas.selected.connect(self._selection_changed)
        canvas.opened.connect(self._open)
        canvas.card_focus_requested.connect(
            lambda: self.card.first_focus_widget().setFocus(Qt.FocusReason.TabFocusReason)
        )
        canvas.toggled.connect(self._toggle_group)
        canvas.quiet_nodes_requested.connect(self._show_quiet)
        canvas.key_pressed.connect(self._handle_key)
        canvas.menu_requested.connect(self._show_menu)
        self.card.closed.connect(lambda: canvas.select(None))
        self.card.inspect_requested.connect(self._open)
        self.card.plot_requested.connect(lambda key: self.context.plot(key, ""))
        self.card.alarm_requested.connect(self.context.request)
        self.card.record_requested.connect(lambda key: self.context.request(RecordTopic(key)))
        self.card.select_requested.connect(self._select_item)

    def _make_page(self) -> QWidget:
        main_area = QWidget()
        column = QVBoxLayout(main_area)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget, stretch in ((self.tools, 0), (self.canvas, 1), (self.note, 0), (self.legend, 0)):
            column.addWidget(widget, stretch)
        page = QWidget()
        self._page_layout = QBoxLayout(QBoxLayout.Direction.LeftToRight, page)
        self._page_layout.setContentsMargins(0, 0, 0, 0)
        self._page_layout.setSpacing(0)
        self._page_layout.addWidget(main_area, 1)
        self._separator = Separator(self.theme, upright=True)
        self._separator.hide()
        self._page_layout.addWidget(self._separator)
        self._page_layout.addWidget(self.card)
        return page

    # -- display ------------------------------------------------------------------------------------------

    def source_changed(self) -> None:
        self._last_snapshot = ()

    def refresh(self) -> None:
        self._ticks += 1
        if self._ticks % QUIET_UPDATE_TICKS == 1:
            self._update_quiet_nodes()
        snapshot = self._snapshot()
        if snapshot != self._last_snapshot:
            self._last_snapshot = snapshot
            self._rebuild()
        self._apply_layout()
        values = (self.world.topics.values_revision, self.world.networks.values_revision)
        if values != self._values_revisions or (
            self._has_gone_nodes() and self._ticks % QUIET_UPDATE_TICKS == 0
        ):
            self._values_revisions = values
            self.canvas.schedule_update()
            self._update_card()
        self.canvas.update_stats(self._stats_of)

    def _snapshot(self) -> tuple[object, ...]:
        session = self.session
        view = session.shown.graph
        graph = (view.epoch, view.revision) if view is not None else None
        counts = (
            session.shown.nodes.revision,
            session.shown.topics.revision,
            session.shown.networks.revision,
        )
        pages = session.web_pages.revision
        return (graph, counts, pages, session.fleet.revision, session.live.master.kind, self._options)

    def _graph_input(self) -> GraphInput:
        session = self.session
        return GraphInput(
            session.shown.all_nodes,
            session.shown.all_topics,
            session.shown.graph.services if session.shown.graph is not None else {},
            [link.name for link in session.fleet.links],
            self._host,
            page_nodes(session.web_pages),
        )

    def _update_quiet_nodes(self) -> None:
        graph_input, now = self._graph_input(), time.monotonic()
        self._quiet.update(graph_input, now)
        self._calls.update(graph_input, now)
        self._call_rates_hz = self._calls.rates_hz()
        self._update_options(quiet_nodes=self._quiet.quiet_keys(now))

    def _rebuild(self) -> None:
        graph_input = self._graph_input()
        options = self._options
        if len(graph_input.nodes) > MAX_EXPANDED_NODES and not (
            options.starts_collapsed or options.toggled_groups
        ):
            self._layout = None
            self._update_options(starts_collapsed=True)
        graph = node_graph(graph_input, self._options)
        self.pages.setCurrentIndex(0 if graph_input.nodes else 1)
        self.export.setVisible(bool(graph_input.nodes))
        if not graph_input.nodes:
            self._update_options(starts_collapsed=False)
            self._update_empty_state()
        self._update_counts(graph)
        if graph != self._requested_graph:
            self._requested_graph, self._requested_sizes = graph, self._sizes()
            self._thread.submit(graph, self._layout, self._requested_sizes)

    def _apply_layout(self) -> None:
        # A large scene is shown one tick after it was built, to keep ticks short.
        scene, self._pending_scene = self._pending_scene, None
        result = self._thread.pop_result()
        if result is not None:
            graph, self._layout = result
            scene = GraphScene(self.theme, graph, self._layout, self._requested_sizes, self._host)
            if len(scene.lines) > MAX_LINES_PER_TICK:
                self._pending_scene = scene
                return
        if scene is not None:
            self._show(scene)

    def _show(self, scene: GraphScene) -> None:
        scene.dim_unmatched(self.tools.filter_words())
        boxes = {node.entry_key: node.key for node in scene.graph.nodes if node.entry_key}
        self._box_of = lambda entry: boxes.get(entry, "")
        self.canvas.show_scene(scene)
        self._update_note(scene.layout)
        self._update_card()

    def _stats_of(self, line: GraphLine) -> LineStats:
        return line_stats(line, self.world.topic, self._call_rates_hz, self._box_of)

    def _has_gone_nodes(self) -> bool:
        graph = self._requested_graph
        return graph is not None and any(node.is_gone for node in graph.nodes)

    def _sizes(self) -> LayoutSizes:
        # Nodes are wide enough for the details of a behaviour, whose length depends on the language.
        sizes = LayoutSizes().scaled(self.theme.scaled(1.0))
        detail_width = paint.width_of(self.theme.font("caption"), behaviour_detail(cpu_text(1.0)))
        width, height = sizes.node
        return replace(sizes, node=(max(width, math.ceil(detail_width + NODE_TEXT_INSET)), height))

    def _update_empty_state(self) -> None:
        if self.session.live.master.kind == "none":
            self.empty.set_texts(
                _("No master is running"), _("A master lets programs find each other."), "radio-tower"
            )
            start = self.session.launcher.ensure_master
            self.empty.set_actions([EmptyAction(_("Start a master here"), start, "play", is_primary=True)])
            return
        hint = _("Programs appear here as soon as they join the master.")
        self.empty.set_texts(_("No nodes yet"), hint, "workflow")
        doctor = EmptyAction(
            _("Open the connection doctor"),
            lambda: self.context.open_doctor(self, ""),
            "stethoscope",
            is_primary=True,
        )
        self.empty.set_actions([doctor])

    def _update_counts(self, graph: NodeGraph) -> None:
        self.count.setText(counts_text(graph))
        if graph.node_count:
            self.tools.show_quiet_count(graph.hidden_quiet_count, self._options.hides_quiet)

    def _update_note(self, layout: GraphLayout) -> None:
        notes = []
        if layout.omitted_routes:
            template = ngettext(
                "{count} line is hidden: too many to draw",
                "{count} lines are hidden: too many to draw",
                layout.omitted_routes,
            )
            notes.append(template.format(count=group_digits(layout.omitted_routes)))
        if layout.is_fallback:
            notes.append(_("The nodes are shown in rows: no better layout was found"))
        self.note.setText(". ".join(notes))
        self.note.setVisible(bool(notes))

    # -- user actions -------------------------------------------------------------------------------------

    def _update_options(self, **changes: object) -> None:
        self._options = replace(self._options, **changes)  # type: ignore[arg-type]
        self.tools.show_options(self._options)

    def _group_by(self, name: str) -> None:
        for group_by in GROUPS:
            if group_by == name:
                self._layout = None
                self._update_options(
                    group_by=group_by, toggled_groups=frozenset(), groups_with_visible_quiet_nodes=frozenset()
                )

    def _toggle_group(self, group: str) -> None:
        self._layout = None
        self._update_options(toggled_groups=self._options.toggled_groups ^ {group})

    def _show_quiet(self, group: str) -> None:
        self._update_options(
            groups_with_visible_quiet_nodes=self._options.groups_with_visible_quiet_nodes | {group}
        )

    def _reset_layout(self) -> None:
        self._layout = self._requested_graph = self._pending_scene = None
        self._last_snapshot = ()
        self.canvas.show_all()

    def _apply_filter(self) -> None:
        if self.canvas.scene is not None:
            self.canvas.scene.dim_unmatched(self.tools.filter_words())
            self.canvas.update()

    def _handle_key(self, key: str) -> None:
        if key == "/":
            self.focus_filter()
        elif key == "g":
            index = GROUPS.index(self._options.group_by)
            self._group_by(GROUPS[(index + 1) % len(GROUPS)])
        elif key == "h":
            self._update_options(
                hides_quiet=not self._options.hides_quiet, groups_with_visible_quiet_nodes=frozenset()
            )
        elif key == "s":
            self._update_options(shows_services=not self._options.shows_services)

    def _open(self, key: str) -> None:
        if self.world.topic(key) is not None:
            show_messages(self.context, key)

    def _show_menu(self, selection: GraphSelection, position: QPoint) -> None:
        menu = self.menu_of(selection)
        menu.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        if menu.actions():
            menu.popup(position)
        else:
            menu.deleteLater()

    def menu_of(self, selection: GraphSelection) -> Menu:
        """Return the context menu of a node or line.

        The menu of a line with several topics has a submenu for each of them, up to `MAX_MENU_TOPICS`.
        """
        menu, scene = Menu(self.theme, self), self.canvas.scene
        graph = scene.graph if scene is not None else NodeGraph()
        if selection.kind == "node":
            return fill_menu(menu, self.theme, self._node_actions(graph.node(selection.key)))
        line = graph.line_of(selection.key)
        topics = line.topics if line is not None else (selection.key,)
        if len(topics) == 1:
            return fill_menu(menu, self.theme, self._topic_actions(topics[0]))
        for topic in sorted(topics, key=lambda each: each != selection.key)[:MAX_MENU_TOPICS]:
            part = Menu(self.theme, menu, plain.escape_menu_text(split_key(topic)[1]))
            menu.addMenu(fill_menu(part, self.theme, self._topic_actions(topic)))
        return menu

    def _topic_actions(self, key: str) -> list[RowAction]:
        if self.world.topic(key) is None:
            network, name = split_key(key)
            return [copy_action(self.context, name)] if network else service_actions(self.context, name)
        return topic_actions(self.context, key)

    def _node_actions(self, node: DrawnNode | None) -> list[RowAction]:
        if node is None:
            return []
        if node.entry is None:
            return [RowAction(_("Expand the group"), "box", lambda: self.canvas.expand_group(node.key))]
        return node_actions(self.context, node.entry.network, node.entry.name)

    def _selection_changed(self, _selection: object) -> None:
        self._update_card()

    def _select_item(self, kind: str, key: str) -> None:
        if kind == "node":
            self.canvas.select(GraphSelection("node", key), by_key=True)
        elif self._requested_graph is not None and self._requested_graph.line_of(key) is not None:
            self.canvas.select(GraphSelection("topic", key), by_key=True)
        else:
            self._open(key)  # a topic without subscribers has no line

    # -- card and texts -----------------------------------------------------------------------------------

    def _card_sources(self) -> CardSources:
        scene = self.canvas.scene
        nodes = scene.graph.nodes if scene is not None else ()
        names = {entry.key: entry.name for entry in self.world.all_nodes}
        names |= {node.entry_key: node_name(node, self._host) for node in nodes if node.entry_key}
        return CardSources(
            self.world.topic,
            self.world.graph,
            lambda entry: names.get(entry, split_key(entry)[1]),
            self._box_of,
            self._call_rates_hz,
            lambda name: is_drawn(name, self._options),
        )

    def _update_card(self) -> None:
        selection, scene = self.canvas.selection, self.canvas.scene
        content = None
        if selection is not None and scene is not None:
            if selection.kind == "topic":
                content = topic_card(selection.key, self._card_sources())
            else:
                node = scene.graph.node(selection.key)
                if node is not None:
                    content = node_card(node, self._services_of(node.entry_key), self._card_sources())
        self.card.show_content(content)
        self._separator.setVisible(content is not None)

    def _services_of(self, entry: str) -> list[tuple[str, bool]]:
        view = self.world.graph
        services: list[tuple[str, bool]] = []
        for name, service in view.services.items() if view is not None else ():
            if is_drawn(name, self._options):
                services += [(name, True)] if any(each.node_id == entry for each in service.servers) else []
                services += [(name, False)] if any(each.node_id == entry for each in service.clients) else []
        return services

    def _description_of(self, selection: GraphSelection | None) -> str:
        scene = self.canvas.scene
        if selection is None or scene is None:
            return ""
        if selection.kind == "topic":
            return self._topic_description(selection.key)
        node = scene.graph.node(selection.key)
        if node is None:
            return ""
        outgoing = [line for line in scene.graph.lines if node.key in line.sources]
        incoming = [line for line in scene.graph.lines if node.key in line.targets]
        template = _("{node}, {facts}. Outgoing lines: {out}. Incoming lines: {into}.")
        return template.format(
            node=node_name(node, self._host), facts=node_detail(node), out=len(outgoing), into=len(incoming)
        )

    def _topic_description(self, key: str) -> str:
        topic = self.world.topic(key)
        scene = self.canvas.scene
        line = scene.graph.line_of(key) if scene is not None else None
        route_text = ""
        if line is not None:
            template = _("from {sources} to {targets}")
            route_text = template.format(
                sources=self._names_text(line.sources), targets=self._names_text(line.targets)
            )
        parts = [split_key(key)[1]]
        rate = finite_or_none(topic.rate_hz) if topic is not None else None
        if topic is not None and rate is not None:
            parts += [short_rate(rate), bandwidth_text(finite_or_none(topic.bandwidth_Bps))]
        return ", ".join(filter(None, (*parts, route_text)))

    def _names_text(self, keys: tuple[str, ...]) -> str:
        scene = self.canvas.scene
        nodes = [scene.graph.node(key) for key in keys[:5]] if scene is not None else []
        names = [node_name(node, self._host) for node in nodes if node is not None]
        more = len(keys) - len(names)
        return (
            line_name(names)
            if not more
            else _("{names} and {count} more").format(names=", ".join(names), count=more)
        )

    # -- files --------------------------------------------------------------------------------------------

    def _prompt_file(self, kind: FileKind) -> None:
        suggestion = Path.home() / _("graph")
        self.context.files.save_as(_("Export the graph"), suggestion, (kind,), self.save)

    def save(self, path: Path, kind: FileKind) -> None:
        """Write the graph to a file and report the result in a toast; does nothing if the graph is empty.

        Args:
            path: File to write.
            kind: `SVG_KIND` for an image, `DOT_KIND` for Graphviz.
        """
        scene = self.canvas.scene
        if scene is None or not scene.nodes:
            return
        data = self.to_svg() if kind is SVG_KIND else self.to_dot().encode("utf-8")
        try:
            write_atomically(path, data)
        except OSError as error:
            template = _("Can't save the graph: {why}")
            self.context.show_toast(template.format(why=error.strerror or str(error)))
        else:
            self.context.show_toast(_("Saved {name}").format(name=path.name))

    def to_svg(self) -> bytes:
        """Return the whole graph as SVG in the colours of the theme; b"" if the graph is empty."""
        scene = self.canvas.scene
        if scene is None or not scene.nodes:
            return b""
        scene.complete(self._stats_of)
        area = scene.bounds.adjusted(-20, -20, 20, 20)
        buffer = QBuffer()
        buffer.open(QIODevice.OpenModeFlag.WriteOnly)
        generator = QSvgGenerator()
        generator.setOutputDevice(buffer)
        generator.setTitle(_("Graph of nodes"))
        generator.setSize(area.size().toSize())
        generator.setViewBox(QRectF(0, 0, area.width(), area.height()))
        painter = QPainter(generator)
        painter.fillRect(QRectF(0, 0, area.width(), area.height()), QColor(self.theme.colour("panel")))
        painter.translate(-area.topLeft())
        paint_scene(scene, painter, area, 1.0)
        painter.end()
        return bytes(buffer.data().data())

    def to_dot(self) -> str:
        """Return the graph in the DOT language of Graphviz."""
        graph = self.canvas.scene.graph if self.canvas.scene is not None else NodeGraph()
        names = {group.key: group_name(group.key, self._host) for group in graph.groups}
        return format_dot(graph, names, lambda line: self._stats_of(line).label)

    # -- overrides ----------------------------------------------------------------------------------------

    def focus_filter(self) -> bool:
        self.tools.filter.setFocus(Qt.FocusReason.ShortcutFocusReason)
        self.tools.filter.selectAll()
        return True

    def show_topic(self, name: str) -> None:
        if self._requested_graph is not None and self._requested_graph.line_of(name) is not None:
            self.canvas.select(GraphSelection("topic", name), by_key=True)

    def more_actions(self) -> list[QAction]:
        return [self._rearrange, self._internal_topics_action]

    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        self._fit_card()

    def _fit_card(self) -> None:
        is_wide = self.width() >= self.theme.scaled(MIN_SIDE_CARD_WIDTH)
        direction = QBoxLayout.Direction
        self._page_layout.setDirection(direction.LeftToRight if is_wide else direction.TopToBottom)
        width = round(self.theme.scaled(CARD_WIDTH))
        self.card.setMinimumWidth(width if is_wide else 0)
        self.card.setMaximumWidth(width if is_wide else 16_777_215)
        self.card.setMaximumHeight(16_777_215 if is_wide else max(120, self.height() // 2))
        self._separator.setFixedSize(*((1, 16_777_215) if is_wide else (16_777_215, 1)))
        self.legend.setVisible(is_wide and self.height() >= self.theme.scaled(420))

    def theme_changed(self) -> None:
        super().theme_changed()
        self._fit_card()
        if self._requested_graph is not None and self._sizes() != self._requested_sizes:
            self._reset_layout()

    def save_state(self) -> dict[str, object]:
        options = self._options
        return {
            "group_by": options.group_by,
            "services": options.shows_services,
            "hides_quiet": options.hides_quiet,
            "own": options.shows_internal,
        }

    def restore_state(self, state: Mapping[str, object]) -> None:
        for group_by in GROUPS:
            if state.get("group_by") == group_by:
                self._update_options(group_by=group_by)
        if isinstance(services := state.get("services"), bool):
            self._update_options(shows_services=services)
        if isinstance(hides := state.get("hides_quiet"), bool):
            self._update_options(hides_quiet=hides)
        if isinstance(shows_own := state.get("own"), bool):
            self._internal_topics_action.setChecked(shows_own)

    def dispose(self) -> None:
        self._thread.close()


PANEL = Panel(
    "graph",
    lazy("Graph"),
    "workflow",
    (),
    GraphPanel,
    home=(TabHome("developer", "topics"), TabHome("behaviour", "behaviour")),
)
