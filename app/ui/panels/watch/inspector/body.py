"""Layout of the inspector: find bar, pages (tree, table, bytes, empty states) and footer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.core.messages.inspected import NO_BASE, InspectedMessage, View
from app.core.networks.networks import topic_label
from app.core.timeline.times import clock_text
from app.ui.panels.watch.inspector.diff import Counts, changes_text, count_changes
from app.ui.panels.watch.inspector.find import FindBar
from app.ui.panels.watch.inspector.footer import Footer
from app.ui.panels.watch.inspector.hex_view import HexView
from app.ui.panels.watch.inspector.history import HistoryStrip
from app.ui.panels.watch.inspector.objects import ObjectsView
from app.ui.panels.watch.inspector.query import QueryStrip
from app.ui.panels.watch.inspector.tree_model import TreeModel
from app.ui.panels.watch.inspector.tree_view import TreeView
from app.ui.text.numbers import size_text
from app.ui.theme.theme import Theme
from app.ui.widgets import ElidedLabel, EmptyAction, EmptyState, IconButton, Segments, Separator, label
from nep.i18n import _, lazy

if TYPE_CHECKING:
    from app.core.messages.lazy_json import JsonIndex
    from app.core.messages.query import QueryResult
    from app.core.messages.reader import ReadResult

NOTHING, LARGE, TREE, RAW, TABLE = range(5)
PAGES = {
    View.EMPTY: NOTHING,
    View.WAITING: NOTHING,
    View.UNREADABLE: NOTHING,
    View.LARGE: LARGE,
    View.READING: LARGE,
    View.TREE: TREE,
    View.TABLE: TABLE,
    View.RAW: RAW,
    View.UNDECODABLE: RAW,
}
MODES = {TREE: "tree", TABLE: "table", RAW: "raw"}
"""Mode of each page that shows a message."""
MAX_EXPANDED_ROWS = 24
PREVIOUS_MESSAGE, PINNED_MESSAGE = lazy("Previous message"), lazy("Pinned message")


class CompareStrip(QWidget):
    """Strip above the tree during a comparison, with a summary and a filter for changed values."""

    changes_only_toggled = Signal(bool)

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self.text_label = ElidedLabel("small", "textSecondary")
        self.changes_only_button = IconButton(
            theme, "filter", _("Show changes only"), checkable=True, size=24
        )
        self.changes_only_button.toggled.connect(self.changes_only_toggled)
        row = QHBoxLayout(self)
        row.setContentsMargins(12, 3, 8, 3)
        row.setSpacing(6)
        row.addWidget(self.text_label, 1)
        row.addWidget(self.changes_only_button)
        self.hide()

    def set_summary(self, compared_with: str, counts: Counts, is_complete: bool) -> None:
        """Show a summary such as ``Previous message: 3 changed, 1 added``.

        Args:
            compared_with: Name of the base message.
            counts: Number of values by kind of difference.
            is_complete: False if the counts are incomplete.
        """
        template = _("{compared_with}: {changes}")
        self.text_label.setText(
            template.format(compared_with=compared_with, changes=changes_text(counts, is_complete))
        )
        self.setAccessibleDescription(self.text_label.text())


class InspectorBody(QWidget):
    """Contents of the inspector below its title bar.

    Args:
        search_source: Returns the value that the find bar searches, and the index of a large message or
            None.
        toast: Shows a toast.
        empty_action: Returns the action to show without a message, given the key of the topic.
        decode_large: Decodes the large message that is offered.
    """

    def __init__(
        self,
        theme: Theme,
        search_source: Callable[[], tuple[object, JsonIndex | None]],
        toast: Callable[[str], None],
        *,
        empty_action: Callable[[str], EmptyAction],
        decode_large: Callable[[], object],
    ) -> None:
        super().__init__()
        self._empty_action = empty_action
        self._decode_action = EmptyAction(
            _("Decode the newest message"), decode_large, "list-tree", is_primary=True
        )
        self._view: View | None = None
        self._empty_texts = ("", "")
        self._reading: ReadResult | None = None
        self.model = TreeModel()
        self.tree = TreeView(theme, self.model)
        self.tree.setAccessibleName(_("Newest message"))
        self.tree.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.finder = FindBar(theme, search_source)
        self.finder.match_selected.connect(self.reveal)
        self.finder.field.exited.connect(lambda: self.tree.setFocus(Qt.FocusReason.ShortcutFocusReason))
        modes = [("tree", _("Tree"), None), ("table", _("Table"), None), ("raw", _("Raw"), None)]
        self.mode = Segments(theme, modes, size="small", name=_("Show as"))
        compare = _("Compare with the previous message")
        self.compare = IconButton(theme, "equal", compare, checkable=True, size=26)
        self.strip = CompareStrip(theme)
        self.query = QueryStrip()
        self.error_label = label("", "small", role="warn", wrap=True)
        self.error_label.setContentsMargins(12, 6, 12, 6)
        self.bytes = HexView(theme)
        self.objects = ObjectsView(theme, toast)
        self.empty = EmptyState(theme, "list-tree", "", "")
        self.large = EmptyState(theme, "database", "", "")
        self.history = HistoryStrip(theme)
        self.foot = Footer(theme)
        self.foot.show_path("")
        self._arrange(theme)

    def _arrange(self, theme: Theme) -> None:
        self.bar = QWidget()
        bar = QHBoxLayout(self.bar)
        bar.setContentsMargins(8, 7, 8, 7)
        bar.setSpacing(6)
        bar.addWidget(self.finder, 1)
        bar.addWidget(self.compare)
        bar.addWidget(self.mode)
        self.separator = Separator(theme)
        self.pages = QStackedWidget()
        for page in (self.empty, self.large, self.tree, self.bytes, self.objects):
            self.pages.addWidget(page)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        for widget in (self.bar, self.separator, self.query, self.strip, self.error_label):
            column.addWidget(widget)
        column.addWidget(self.pages, 1)
        column.addWidget(self.history)
        column.addWidget(self.foot)

    @property
    def page(self) -> int:
        """Index of the current page."""
        return self.pages.currentIndex()

    def show_message(self, inspected: InspectedMessage, now: float) -> None:
        """Show a message in its view, or the reason why there is none.

        Args:
            inspected: Message and view.
            now: Monotonic time in s.
        """
        page = PAGES[inspected.view]
        is_comparing = self.is_comparing(inspected)
        if inspected.reading is not self._reading:
            self._reading = inspected.reading
            self.finder.invalidate_matches()
        if page == NOTHING:
            self._show_empty(inspected)
        elif page == LARGE:
            self._show_large(inspected)
        elif page == RAW:
            self._show_bytes(inspected)
        elif self.query.has_query:
            self.query.request_evaluation(inspected.value)
        elif page == TABLE:
            self.objects.show_message(inspected.value, now)
        else:
            base = inspected.base if is_comparing else NO_BASE
            changes_only = base is not NO_BASE and self.strip.changes_only_button.isChecked()
            is_first = not self.model.rowCount()
            self.model.set_value(inspected.value, now, base, changes_only=changes_only)
            if is_first:
                self.tree.expand_small(MAX_EXPANDED_ROWS)
            if is_comparing:
                self.strip.set_summary(_base_text(inspected), *count_changes(inspected.value, base))
        self._view = inspected.view
        self.foot.show_message(inspected)
        self._show_page(page, is_comparing=is_comparing)

    def is_comparing(self, inspected: InspectedMessage) -> bool:
        """Return True if the tree shows the differences to another message."""
        return (self.compare.isChecked() or inspected.is_pinned) and not self.query.has_query

    def show_query_result(self, result: QueryResult, now: float) -> None:
        """Show the values that a query found.

        Args:
            result: Result of the query.
            now: Monotonic time in s.
        """
        if self.page == TABLE:
            self.objects.show_query_objects(result.values.items(), now)
            return
        is_first = not self.model.rowCount()
        self.model.set_value(result.values, now)
        if is_first:
            self.tree.expand_small(MAX_EXPANDED_ROWS)

    def _show_page(self, page: int, *, is_comparing: bool) -> None:
        self.error_label.setVisible(page == RAW and bool(self.error_label.text()))
        self.pages.setCurrentIndex(page)
        for widget in (self.bar, self.separator, self.foot):
            widget.setVisible(page in MODES)
        self.query.update_visibility(can_show_results=page in {TREE, TABLE})
        self.strip.setVisible(page == TREE and is_comparing)
        self.foot.legend.setVisible(page == TREE)
        if page in MODES:
            self.mode.set_value(MODES[page])

    def _show_empty(self, inspected: InspectedMessage) -> None:
        self.model.clear()
        self.query.discard_pending()
        self.foot.show_path("")
        topic = topic_label(inspected.key)
        title, text = _("No message yet"), _("The next message on {topic} appears here.")
        if inspected.view is View.EMPTY:
            title, text = _("Nothing selected"), _("Click a topic to see its newest message.")
        elif inspected.view is View.UNREADABLE:
            title, text = _("Can't decode the messages"), _("{topic}: {reason}.")
        elif not inspected.has_publisher:
            text = _("There is no publisher at the moment. The next message on {topic} appears here.")
        text = text.format(topic=topic, reason=inspected.reason)
        if (title, text) != self._empty_texts:  # otherwise the button would be replaced while it is pressed
            self._empty_texts = (title, text)
            self.empty.set_texts(title, text)
            self.empty.set_actions([self._empty_action(inspected.key)])

    def _show_large(self, inspected: InspectedMessage) -> None:
        is_offered = inspected.view is View.LARGE
        text = _("Reading the message…")
        if is_offered and inspected.message is not None:
            text = _("{codec} messages larger than 1 MB are decoded only on request.")
            text = text.format(codec=inspected.message.codec)
        title = _("Large message ({size})").format(size=size_text(inspected.large_bytes))
        self.large.set_texts(title, text)
        if inspected.view is not self._view:  # otherwise the button would be replaced while it is pressed
            self.large.set_actions([self._decode_action] if is_offered else [])

    def _show_bytes(self, inspected: InspectedMessage) -> None:
        message = inspected.message
        if message is not None:
            self.bytes.show_bytes(message.data)
            text = _("Can't decode the message as {codec}: {reason}.")
            text = text.format(codec=message.codec, reason=inspected.reason)
            self.error_label.setText(text if inspected.reason else "")

    def reveal(self, path: object) -> None:
        """Select the value at a path in the tree and scroll to it."""
        index = self.model.index_of_path(path)  # type: ignore[arg-type]
        self.tree.setCurrentIndex(index)
        self.tree.scrollTo(index)


def _base_text(inspected: InspectedMessage) -> str:
    if not inspected.is_pinned:
        return _(PREVIOUS_MESSAGE)
    stamp_ns = inspected.pinned_stamp_ns
    if stamp_ns is None or not 0 <= stamp_ns < 2**62:
        return _(PINNED_MESSAGE)
    return _("{message} from {clock}").format(message=_(PINNED_MESSAGE), clock=clock_text(stamp_ns))
