"""Layout of the inspector: find bar, pages (tree, table, bytes, empty states) and footer."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import QHBoxLayout, QStackedWidget, QVBoxLayout, QWidget

from app.ui.panels.watch.inspector.diff import Counts, changes_text
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
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.messages.lazy_json import JsonIndex

NOTHING, LARGE, TREE, RAW, TABLE = range(5)
MODES = {TREE: "tree", TABLE: "table", RAW: "raw"}
"""Mode of each page that shows a message."""


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
    """

    def __init__(
        self,
        theme: Theme,
        search_source: Callable[[], tuple[object, JsonIndex | None]],
        toast: Callable[[str], None],
    ) -> None:
        super().__init__()
        self._waiting_text = ""
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

    def show_page(self, page: int, *, is_comparing: bool) -> None:
        """Show a page and the widgets that belong to it.

        Args:
            page: `NOTHING`, `LARGE`, `TREE`, `RAW` or `TABLE`.
            is_comparing: True if the tree shows the differences to another message.
        """
        text = self.error_label.text() if page == RAW else ""
        self.error_label.setText(text)
        self.error_label.setVisible(bool(text))
        self.pages.setCurrentIndex(page)
        for widget in (self.bar, self.separator, self.foot):
            widget.setVisible(page in MODES)
        self.query.update_visibility(can_show_results=page in {TREE, TABLE})
        self.strip.setVisible(page == TREE and is_comparing)
        self.foot.legend.setVisible(page == TREE)
        if page in MODES:
            self.mode.set_value(MODES[page])

    def show_waiting(self, topic: str, has_publisher: bool, doctor_action: EmptyAction) -> None:
        """Show the empty state for a topic whose first message has not arrived yet.

        Args:
            topic: Name of the topic.
            has_publisher: True if the topic has a publisher.
            doctor_action: Action that opens the connection doctor.
        """
        if has_publisher:
            text = _("The next message on {topic} appears here.")
        else:
            text = _("There is no publisher at the moment. The next message on {topic} appears here.")
        text = text.format(topic=topic)
        if text != self._waiting_text:
            self._waiting_text = text
            self.empty.set_texts(_("No message yet"), text)
            self.empty.set_actions([doctor_action])

    def show_undecodable(self, topic: str, reason: str, doctor_action: EmptyAction) -> None:
        """Show the empty state for a topic whose messages can't be decoded.

        Args:
            topic: Name of the topic.
            reason: Reason why decoding fails.
            doctor_action: Action that opens the connection doctor.
        """
        text = _("{topic}: {reason}.").format(topic=topic, reason=reason)
        if text != self._waiting_text:
            self._waiting_text = text
            self.empty.set_texts(_("Can't decode the messages"), text)
            self.empty.set_actions([doctor_action])

    def show_empty(self, topic: str, choose: Callable[[], object], doctor_action: EmptyAction) -> None:
        """Show the empty state before the first message or without a selected topic.

        Args:
            topic: Name of the selected topic; "" if none is selected.
            choose: Lets the user select a topic.
            doctor_action: Action that opens the connection doctor.
        """
        self._waiting_text = ""
        if topic:
            self.show_waiting(topic, has_publisher=True, doctor_action=doctor_action)
        else:
            self.empty.set_texts(_("Nothing selected"), _("Click a topic to see its newest message."))
            self.empty.set_actions([EmptyAction(_("Choose a topic"), choose, "list")])

    def show_large(self, size_bytes: int, explanation: str, read: Callable[[], object] | None = None) -> None:
        """Show the size of a large message instead of its values.

        Args:
            size_bytes: Size of the message in bytes.
            explanation: Sentence below the size, such as the reason why the values aren't shown.
            read: Decodes the message when the user clicks the button; None for no button.
        """
        self.large.set_texts(_("Large message ({size})").format(size=size_text(size_bytes)), explanation)
        if read is None:
            self.large.set_actions([])
        elif self.page != LARGE:
            action = EmptyAction(_("Decode the newest message"), read, "list-tree", is_primary=True)
            self.large.set_actions([action])

    def reveal(self, path: object) -> None:
        """Select the value at a path in the tree and scroll to it."""
        index = self.model.index_of_path(path)  # type: ignore[arg-type]
        self.tree.setCurrentIndex(index)
        self.tree.scrollTo(index)
