"""Storage of the block editor's backpack in a file shared by all of the user's Studio instances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from PySide6.QtCore import SignalInstance

from app.blocks.model import deep_json
from app.core.projects.backpack import Backpack, BackpackStack
from app.errors import BackpackError
from app.ui.panels.base import PanelContext
from nep.i18n import _, ngettext
from nep.text import bounded_str

POLL_TICKS = 30  # refreshes at 30 Hz: changes made by another instance of Studio appear within a second


class BackpackView(Protocol):
    """Interface of the block editor for displaying the backpack."""

    backpack_requested: SignalInstance

    def set_backpack(self, items: Sequence[Mapping[str, object]]) -> None: ...


class BackpackController:
    """Handler of the block editor's requests about the backpack.

    A request is a JSON object with the operation in ``do``: "put" (with ``blocks``, ``count`` and
    ``notes``), "remove" (with ``id``), "empty", or "look" to reload the file. The toast of each change
    offers to undo it.
    """

    def __init__(self, context: PanelContext, backpack: Backpack, editor: BackpackView) -> None:
        self._context, self._backpack, self._editor = context, backpack, editor
        self._shown_revision = -1
        self._ticks = 0
        editor.backpack_requested.connect(self._handle_request)
        self.reload_if_changed()

    def tick(self) -> None:
        """Poll for changes made by another instance of Studio; call on every refresh."""
        self._ticks += 1
        if self._ticks % POLL_TICKS == 0:
            self.reload_if_changed()

    def reload_if_changed(self) -> None:
        """Reload and show the backpack if its file changed."""
        self._backpack.reload_if_changed()
        self._show()

    def _show(self) -> None:
        problem = self._backpack.take_problem()
        if problem:
            self._context.show_toast(_capitalize_first(problem))
        if self._shown_revision != self._backpack.revision:
            self._shown_revision = self._backpack.revision
            self._editor.set_backpack([item.to_json() for item in self._backpack.items])

    def _handle_request(self, request_json: str) -> None:
        try:
            request = deep_json.loads(request_json)
        except (ValueError, RecursionError):
            return
        if not isinstance(request, Mapping):
            return
        if request.get("do") == "look":
            self.reload_if_changed()
        elif request.get("do") == "put":
            blocks, count = request.get("blocks"), request.get("count")
            if isinstance(blocks, list) and isinstance(count, int):
                self._add(blocks, count, has_notes=bool(request.get("notes")))
        elif request.get("do") == "remove":
            self._remove(lambda: self._backpack.remove([bounded_str(request.get("id"))]), removes_all=False)
        elif request.get("do") == "empty":
            self._remove(self._backpack.empty, removes_all=True)

    def _add(self, blocks: Sequence[Mapping[str, object]], count: int, *, has_notes: bool) -> None:
        # `has_notes` is True if the selection contained notes, which the backpack doesn't store.
        added: list[BackpackStack] = []
        if blocks and self._apply_change(lambda: added.extend(self._backpack.add(blocks))):
            template = ngettext(
                "Added {count} block to the backpack", "Added {count} blocks to the backpack", count
            )
            ids = [item.id for item in added]
            message = template.format(count=count)
            if has_notes:
                message = _("{what}. Notes weren't added: the backpack can only hold blocks.").format(
                    what=message
                )
            self._context.show_toast(
                message, _("Undo"), lambda: self._apply_change(lambda: self._backpack.remove(ids))
            )

    def _remove(self, remove: Callable[[], list[BackpackStack]], *, removes_all: bool) -> None:
        removed: list[BackpackStack] = []
        if self._apply_change(lambda: removed.extend(remove())) and removed:
            message = _("Emptied the backpack") if removes_all else _("Removed from the backpack")
            self._context.show_toast(
                message, _("Undo"), lambda: self._apply_change(lambda: self._backpack.restore(removed))
            )

    def _apply_change(self, change: Callable[[], object]) -> bool:
        try:
            change()
        except BackpackError as error:
            self._context.show_toast(_capitalize_first(str(error)))
            return False
        finally:
            self._show()
        return True


def _capitalize_first(text: str) -> str:
    return text[:1].upper() + text[1:]
