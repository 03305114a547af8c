"""Storage of the block editor's backpack in a file shared by all of the user's Studio instances."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

from app.core.projects.backpack import Backpack, BackpackStack
from app.errors import BackpackError
from app.ui.blockly.messages import (
    BackpackAdded,
    BackpackEmptied,
    BackpackItem,
    BackpackMessage,
    BackpackOpened,
    BackpackRemoved,
    reject_unhandled,
)
from app.ui.panels.base import PanelContext
from nep.i18n import _, ngettext

POLL_TICKS = 30  # refreshes at 30 Hz: changes made by another instance of Studio appear within a second


class BackpackView(Protocol):
    """Interface of the block editor for displaying the backpack."""

    def set_backpack(self, items: Sequence[BackpackItem]) -> None: ...


class BackpackController:
    """Handler of the block editor's messages about the backpack.

    The toast of each change offers to undo it.
    """

    def __init__(self, context: PanelContext, backpack: Backpack, editor: BackpackView) -> None:
        self._context, self._backpack, self._editor = context, backpack, editor
        self._shown_revision = -1
        self._ticks = 0
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
            self._editor.set_backpack([BackpackItem(item.id, item.block) for item in self._backpack.items])

    def handle(self, message: BackpackMessage) -> None:
        """Handle a message from the page about the backpack."""
        match message:
            case BackpackOpened():
                self.reload_if_changed()
            case BackpackAdded():
                self._add(message.blocks, message.count, has_notes=message.has_notes)
            case BackpackRemoved():
                self._remove(lambda: self._backpack.remove([message.id]), removes_all=False)
            case BackpackEmptied():
                self._remove(self._backpack.empty, removes_all=True)
            case _:
                reject_unhandled(message)

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
