"""Lazy tree model of a decoded message.

Nodes are created when they become visible and reused for later messages. Expanded nodes and the scroll
position therefore persist, and each node knows when its value changed. If there is a base message,
every node has the kind of difference to that message.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QAbstractItemModel, QModelIndex, QPersistentModelIndex, Qt

from app.core.messages.inspected import NO_BASE
from app.core.messages.query import FoundPath
from app.core.series.field_path import ALL, FieldPath, Step, kind_of_value
from app.ui.panels.watch.inspector.diff import (
    MARK_TEXTS,
    ChildDiff,
    Mark,
    child_diffs,
    differs,
)
from app.ui.panels.watch.inspector.values import (
    as_container,
    is_container,
    keys_of,
    size_of,
    value_text,
    values_of,
)
from app.ui.text import plain
from nep.i18n import _

Index = QModelIndex | QPersistentModelIndex
PAGE_SIZE = 500
NODE_ROLE = int(Qt.ItemDataRole.UserRole)
_ROOT = QModelIndex()


@dataclass(slots=True, eq=False)
class TreeNode:
    """Node in the tree of a message's values.

    Attributes:
        key: Key in the parent object, or index in the parent list.
        value: Value in the message.
        parent: Parent node; None for the root.
        row: Index among the children of the parent.
        depth: Number of ancestors below the root; -1 for the root.
        children: Child nodes; None until they are loaded.
        changed_s: Monotonic time in s of the last change of the value; None if it has not changed.
        base: Value in the base message; `MISSING` if it was added, `NO_BASE` without a base message.
        mark: Kind of difference between `value` and `base`.
        total: Number of children in a comparison; 0 until they are loaded, and without a base message.
    """

    key: str | int
    value: object
    parent: TreeNode | None
    row: int = 0
    depth: int = 0
    children: list[TreeNode] | None = None
    changed_s: float | None = None
    base: object = NO_BASE
    mark: Mark = ""
    total: int = 0

    @property
    def is_container(self) -> bool:
        """True for objects and lists."""
        return is_container(self.value)

    @property
    def path(self) -> str:
        """Field path, such as ``people[0].name``; empty for the root."""
        if self.parent is None:
            return ""
        above = self.parent.path
        if isinstance(self.key, int):
            return f"{above}[{self.key}]"
        return f"{above}.{self.key}" if above else self.key


def field_of(node: TreeNode) -> str:
    """Return the field path for plotting a value, or "" if the value can't be plotted.

    For a list of numbers, the path stands for all elements.
    """
    kind = kind_of_value(node.value)
    suffix: tuple[Step, ...] = (ALL,) if kind == "list" else ()
    return str(FieldPath((*steps_of(node), *suffix))) if kind is not None else ""


def steps_of(node: TreeNode) -> tuple[str | int, ...]:
    """Return the keys and indices that lead from the message to a node, also for the results of a query."""
    steps: list[str | int] = []
    above: TreeNode | None = node
    while above is not None and above.parent is not None:
        steps[:0] = above.key.steps if isinstance(above.key, FoundPath) else (above.key,)
        above = above.parent
    return tuple(steps)


class TreeModel(QAbstractItemModel):
    """Item model with one column. The rows of one message are reused for the next one."""

    def __init__(self) -> None:
        super().__init__()
        self._root = TreeNode("", {}, None, depth=-1, children=[])
        self.changed_at_s: float | None = None
        self._is_changing = False
        self._shows_changes_only = False

    # -- QAbstractItemModel -------------------------------------------------------------------------------

    def index(self, row: int, column: int, parent: Index = _ROOT) -> QModelIndex:
        above = self.node(parent)
        if above.children is None or not 0 <= row < len(above.children) or column != 0:
            return QModelIndex()
        return self.createIndex(row, column, above.children[row])

    def parent(self, index: Index = _ROOT) -> QModelIndex:  # type: ignore[override]
        above = self.node(index).parent if index.isValid() else None
        if above is None or above is self._root:
            return QModelIndex()
        return self.createIndex(above.row, 0, above)

    def rowCount(self, parent: Index = _ROOT) -> int:
        return len(self.node(parent).children or ()) if parent.column() <= 0 else 0

    def columnCount(self, _parent: Index = _ROOT) -> int:
        return 1

    def hasChildren(self, parent: Index = _ROOT) -> bool:
        node = self.node(parent)
        return parent.column() <= 0 and (bool(node.children) or self._size(node) > 0)

    def canFetchMore(self, parent: Index) -> bool:
        node = self.node(parent)
        # A view may call this while rows are being changed, and calls it again afterwards.
        return parent.column() <= 0 and not self._is_changing and len(node.children or ()) < self._size(node)

    def fetchMore(self, parent: Index) -> None:
        if self._is_changing:
            return
        node = self.node(parent)
        loaded_count = len(node.children or ())
        self._load(node, loaded_count + PAGE_SIZE)

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        node = self.node(index)
        if role == NODE_ROLE:
            return node
        if role == Qt.ItemDataRole.DisplayRole:
            return str(node.key)
        if role == Qt.ItemDataRole.ToolTipRole:
            return plain.tip(node.path)
        if role == Qt.ItemDataRole.AccessibleTextRole:
            parts = (str(node.key), value_text(node.value), _(MARK_TEXTS.get(node.mark, "")))
            return ", ".join(part for part in parts if part)
        return None

    # -- access by the inspector --------------------------------------------------------------------------

    def node(self, index: Index) -> TreeNode:
        """Return the node of an index; the root for an invalid index."""
        pointer = index.internalPointer() if index.isValid() else None
        return pointer if isinstance(pointer, TreeNode) else self._root

    def index_of(self, node: TreeNode) -> QModelIndex:
        """Return the index of a node."""
        return QModelIndex() if node is self._root else self.createIndex(node.row, 0, node)

    def value(self) -> object:
        """Return the whole message.

        A message that is not an object or list is returned in an object with the key ``value``.
        """
        return self._root.value

    def clear(self) -> None:
        """Remove all rows; the next message is treated as the first."""
        self.beginResetModel()
        self._root = TreeNode("", {}, None, depth=-1, children=[])
        self.changed_at_s = None
        self.endResetModel()

    def set_value(
        self, value: object, now: float, base: object = NO_BASE, *, changes_only: bool = False
    ) -> None:
        """Update the tree to another message.

        Values of the first message don't count as changed.

        Args:
            value: Decoded message. A message that is not an object or list becomes one row called
                ``value``.
            now: Monotonic time in s, stored as the change time of changed values.
            base: Message to compare with, or `NO_BASE`.
            changes_only: True to omit nodes that are equal in both messages.
        """
        is_first = not self._root.children
        container = as_container(value)
        base_container = base if base is NO_BASE else as_container(base)
        self._shows_changes_only = changes_only
        self._is_changing = True
        try:
            self._update(self._root, (0, container, base_container, ""), None if is_first else now)
            if not self._root.children:
                self._load(self._root, PAGE_SIZE)
        finally:
            self._is_changing = False

    def _size(self, node: TreeNode) -> int:
        # In a comparison, the count of an unloaded node is only known to be zero or not.
        if node.base is NO_BASE:
            return size_of(node.value)
        return node.total if node.children is not None else size_of(node.value) or size_of(node.base)

    def _parts(self, node: TreeNode, count: int) -> list[ChildDiff]:
        if node.base is NO_BASE:
            pairs = zip(keys_of(node.value, count), values_of(node.value, count), strict=False)
            return [(key, value, NO_BASE, "") for key, value in pairs]
        changes_only = self._shows_changes_only
        parts, node.total = child_diffs(node.value, node.base, node.mark, count, changes_only=changes_only)
        return parts

    def _update(self, node: TreeNode, part: ChildDiff, now: float | None) -> None:
        _key, value, base, mark = part
        before, node.value = node.value, value
        is_mark_changed, node.mark, node.base = node.mark != mark, mark, base
        loaded = node.children
        if loaded is None:
            if now is not None and not is_container(value) and differs(before, value):
                node.changed_s = self.changed_at_s = now
            if is_mark_changed:
                self._emit_changed(node, node)
            return
        parts = self._parts(node, max(len(loaded), PAGE_SIZE) if loaded or is_container(value) else 0)
        keys = [each[0] for each in parts]
        if [child.key for child in loaded] != keys[: len(loaded)] or len(keys) < len(loaded):
            self._sync_children(node, loaded, parts)
        elif len(keys) > len(loaded):
            self._load(node, len(keys))
        if not is_container(value) and node is not self._root:
            node.children = None
            return
        for child, newer in zip(loaded, parts, strict=False):
            self._update(child, newer, now)
        rows = [child.row for child in loaded if child.changed_s == now and now is not None]
        if rows:
            self._emit_changed(loaded[rows[0]], loaded[rows[-1]])

    def _emit_changed(self, first: TreeNode, last: TreeNode) -> None:
        if first is not self._root:
            roles = [Qt.ItemDataRole.DisplayRole]
            self.dataChanged.emit(self.index_of(first), self.index_of(last), roles)

    def _load(self, node: TreeNode, count: int) -> None:
        parts = self._parts(node, count)
        if node.children is None:
            node.children = []
        first = len(node.children)
        if len(parts) <= first:
            return
        new_nodes = [_make_node(node, row, parts[row]) for row in range(first, len(parts))]
        # receivers of the signals must not load the same rows
        was_changing, self._is_changing = self._is_changing, True
        self.beginInsertRows(self.index_of(node), first, len(parts) - 1)
        node.children.extend(new_nodes)
        self._is_changing = was_changing
        self.endInsertRows()

    def _sync_children(self, node: TreeNode, loaded: list[TreeNode], parts: Sequence[ChildDiff]) -> None:
        # Nodes that still exist keep their expanded state.
        keys = [part[0] for part in parts]
        key_set = set(keys)
        for row in range(len(loaded) - 1, -1, -1):
            if loaded[row].key not in key_set:
                self.beginRemoveRows(self.index_of(node), row, row)
                del loaded[row]
                _renumber(loaded)
                self.endRemoveRows()
        loaded_keys = {child.key for child in loaded}
        if [key for key in keys if key in loaded_keys] != [child.key for child in loaded]:
            self._reorder(loaded, keys)
        for row, part in enumerate(parts):
            if part[0] not in loaded_keys:
                self.beginInsertRows(self.index_of(node), row, row)
                loaded.insert(row, _make_node(node, row, part))
                _renumber(loaded)
                self.endInsertRows()

    def _reorder(self, loaded: list[TreeNode], keys: Sequence[str | int]) -> None:
        positions = {key: number for number, key in enumerate(keys)}
        self.layoutAboutToBeChanged.emit()
        before = self.persistentIndexList()
        nodes = [self.node(index) for index in before]
        loaded.sort(key=lambda child: positions[child.key])
        _renumber(loaded)
        self.changePersistentIndexList(before, [self.index_of(node) for node in nodes])
        self.layoutChanged.emit()

    def index_of_path(self, path: Sequence[str | int]) -> QModelIndex:
        """Return the index of the value at a path.

        The parents of the value are loaded if necessary. The index is invalid if there is no such
        value, or if the value is omitted because it is unchanged.
        """
        node = self._root
        for key in path:
            keys: list[str | int] = keys_of(node.value, size_of(node.value))
            if key not in keys:
                return QModelIndex()
            self._load(node, max(keys.index(key) + 1, min(PAGE_SIZE, len(keys))))
            below = next((child for child in node.children or () if child.key == key), None)
            if below is None:
                return QModelIndex()  # omitted because it is unchanged
            node = below
        return self.index_of(node)


def _make_node(parent: TreeNode, row: int, part: ChildDiff) -> TreeNode:
    key, value, base, mark = part
    return TreeNode(key, value, parent, row, parent.depth + 1, base=base, mark=mark)


def _renumber(nodes: Sequence[TreeNode]) -> None:
    for row, node in enumerate(nodes):
        node.row = row
