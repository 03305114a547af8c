"""A lazy tree over one decoded message: nodes are made when they are seen, and stay when the next one comes.

So what is expanded stays expanded, the scroll position stays, and a value that differs from the one before is
marked with the time of its change.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from PySide6.QtCore import QAbstractItemModel, QModelIndex, QPersistentModelIndex, Qt

from app.ui.tree_values import is_container, keys_of, size_of, values_of, words_of

Index = QModelIndex | QPersistentModelIndex
PAGE = 500
NODE_ROLE = int(Qt.ItemDataRole.UserRole)
_ROOT = QModelIndex()


@dataclass(slots=True, eq=False)
class Node:
    """One value of the message: ``children`` is None until somebody looked into it."""

    key: str | int
    value: object
    parent: Node | None
    row: int = 0
    depth: int = 0
    children: list[Node] | None = None
    changed_s: float | None = None

    @property
    def is_container(self) -> bool:
        """Whether it can have children."""
        return is_container(self.value)

    @property
    def path(self) -> str:
        """Where it is in the message: ``people[0].name``."""
        if self.parent is None:
            return ""
        above = self.parent.path
        if isinstance(self.key, int):
            return f"{above}[{self.key}]"
        return f"{above}.{self.key}" if above else self.key


class TreeModel(QAbstractItemModel):
    """The newest message as rows of one column; `set_value` puts the next message into the same rows."""

    def __init__(self) -> None:
        """Nothing is shown yet."""
        super().__init__()
        self._root = Node("", {}, None, depth=-1, children=[])
        self.changed_at_s: float | None = None
        self._changing = False

    # -- Qt's questions ---------------------------------------------------------------------------------

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
        return parent.column() <= 0 and (bool(node.children) or size_of(node.value) > 0)

    def canFetchMore(self, parent: Index) -> bool:
        node = self.node(parent)
        # While rows are being changed a view may ask; it gets more when the change is complete.
        return parent.column() <= 0 and not self._changing and len(node.children or ()) < size_of(node.value)

    def fetchMore(self, parent: Index) -> None:
        if self._changing:
            return
        node = self.node(parent)
        have = len(node.children or ())
        self._load(node, min(size_of(node.value), have + PAGE))

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> object:
        if not index.isValid():
            return None
        node = self.node(index)
        if role == NODE_ROLE:
            return node
        if role == Qt.ItemDataRole.DisplayRole:
            return str(node.key)
        if role == Qt.ItemDataRole.ToolTipRole:
            return node.path
        if role == Qt.ItemDataRole.AccessibleTextRole:
            return f"{node.key}, {words_of(node.value)}"
        return None

    # -- what the inspector asks and says ---------------------------------------------------------------

    def node(self, index: Index) -> Node:
        """The node of an index; the invisible root for an invalid one."""
        inside = index.internalPointer() if index.isValid() else None
        return inside if isinstance(inside, Node) else self._root

    def index_of(self, node: Node) -> QModelIndex:
        """The index of a node."""
        return QModelIndex() if node is self._root else self.createIndex(node.row, 0, node)

    def value(self) -> object:
        """The whole message that is shown."""
        return self._root.value

    def clear(self) -> None:
        """Show nothing; the next message begins anew."""
        self.beginResetModel()
        self._root = Node("", {}, None, depth=-1, children=[])
        self.changed_at_s = None
        self.endResetModel()

    def set_value(self, value: object, now: float) -> None:
        """Show the next message; values that differ are marked as changed at ``now`` (monotonic s).

        A message that is no container is shown as one row called ``value``. The first message marks nothing.
        """
        first = not self._root.children
        shown = value if is_container(value) else {"value": value}
        self._changing = True
        try:
            self._update(self._root, shown, None if first else now)
            if not self._root.children:
                self._load(self._root, min(size_of(shown), PAGE))
        finally:
            self._changing = False

    def _update(self, node: Node, value: object, now: float | None) -> None:
        before, node.value = node.value, value
        loaded = node.children
        if loaded is None:
            if now is not None and not is_container(value) and _differs(before, value):
                node.changed_s = self.changed_at_s = now
            return
        wanted = keys_of(value, max(len(loaded), PAGE) if loaded or is_container(value) else 0)
        if [child.key for child in loaded] != wanted[: len(loaded)] or len(wanted) < len(loaded):
            self._fit(node, loaded, wanted)
        elif len(wanted) > len(loaded):
            self._load(node, len(wanted))
        if not is_container(value) and node is not self._root:
            node.children = None
            return
        values = values_of(value, len(loaded))
        for child, newer in zip(loaded, values, strict=False):
            self._update(child, newer, now)
        self._tell_values(node, now)

    def _tell_values(self, node: Node, now: float | None) -> None:
        rows = [child.row for child in node.children or () if child.changed_s == now and now is not None]
        if rows and node.children:
            first, last = node.children[rows[0]], node.children[rows[-1]]
            roles = [Qt.ItemDataRole.DisplayRole]
            self.dataChanged.emit(self.index_of(first), self.index_of(last), roles)

    def _load(self, node: Node, count: int) -> None:
        """Have ``count`` children."""
        if node.children is None:
            node.children = []
        first = len(node.children)
        if count <= first:
            return
        keys, values = keys_of(node.value, count), values_of(node.value, count)
        fresh = [
            Node(keys[row], values[row], node, row, node.depth + 1)
            for row in range(first, min(count, len(keys)))
        ]
        self.beginInsertRows(self.index_of(node), first, first + len(fresh) - 1)
        node.children.extend(fresh)
        self.endInsertRows()

    def _fit(self, node: Node, loaded: list[Node], wanted: Sequence[str | int]) -> None:
        """Children came, went or changed places: those that stay keep what is expanded in them."""
        keep = set(wanted)
        for row in range(len(loaded) - 1, -1, -1):
            if loaded[row].key not in keep:
                self.beginRemoveRows(self.index_of(node), row, row)
                del loaded[row]
                _number(loaded)
                self.endRemoveRows()
        have = {child.key for child in loaded}
        if [key for key in wanted if key in have] != [child.key for child in loaded]:
            self._reorder(loaded, wanted)
        for row, key in enumerate(wanted):
            if key not in have:
                self.beginInsertRows(self.index_of(node), row, row)
                loaded.insert(row, Node(key, _child(node.value, key), node, row, node.depth + 1))
                _number(loaded)
                self.endInsertRows()

    def _reorder(self, loaded: list[Node], wanted: Sequence[str | int]) -> None:
        place = {key: number for number, key in enumerate(wanted)}
        self.layoutAboutToBeChanged.emit()
        before = self.persistentIndexList()
        nodes = [self.node(index) for index in before]
        loaded.sort(key=lambda child: place[child.key])
        _number(loaded)
        self.changePersistentIndexList(before, [self.index_of(node) for node in nodes])
        self.layoutChanged.emit()

    def reveal(self, path: Sequence[str | int]) -> QModelIndex:
        """The index of a value, loading what leads to it; invalid when it is not there."""
        node = self._root
        for key in path:
            keys = keys_of(node.value, size_of(node.value))
            if key not in keys:
                return QModelIndex()
            self._load(node, max(keys.index(key) + 1, min(PAGE, len(keys))))
            node = (node.children or [])[keys.index(key)]
        return self.index_of(node)


def _child(value: object, key: str | int) -> object:
    if isinstance(value, Mapping):
        if key in value:
            return value[key]
        return next((below for name, below in value.items() if str(name) == key), None)
    return value[key] if isinstance(value, Sequence) and isinstance(key, int) else None


def _number(nodes: Sequence[Node]) -> None:
    for row, node in enumerate(nodes):
        node.row = row


def _differs(before: object, after: object) -> bool:
    # NaN differs from itself, but it has not changed. 1 and true are equal in Python, not in JSON.
    if before is after or (before != before and after != after):  # noqa: PLR0124
        return False
    return type(before) is not type(after) or before != after
