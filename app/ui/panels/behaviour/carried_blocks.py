"""Blocks that are carried out of the page: the tab on which they are let go opens and takes them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from PySide6.QtCore import QPoint, QTimer, SignalInstance

from app.core.session import Session
from app.ui.panels.base import PanelContext
from app.ui.panels.behaviour.tabs import NEW, BehaviourTabs
from nep.i18n import _, ngettext

SCROLL_MS = 16


class Carrier(Protocol):
    """The editor, as far as blocks leave it."""

    block_carried: SignalInstance
    block_dropped: SignalInstance
    blocks_brought: SignalInstance

    def bring_blocks(self) -> None: ...
    def give_blocks_back(self) -> None: ...


class CarriedBlocks:
    """Marks the tab under a block that is carried out of the page, and lets it have the block there.

    Let go on "+" a new behaviour takes it; let go elsewhere it is where it was. Held near an end of the row
    it brings the tabs that are out of sight there.
    """

    def __init__(
        self,
        context: PanelContext,
        session: Session,
        tabs: BehaviourTabs,
        editor: Carrier,
        flush: Callable[[Callable[[], None]], None],
        show: Callable[[], None],
    ) -> None:
        """``flush`` calls back once the newest edits are known; ``show`` shows the current behaviour now."""
        self._context, self._session, self._tabs, self._editor = context, session, tabs, editor
        self._flush, self._show = flush, show
        self._from = ""
        self._held_at: QPoint | None = None
        self._scrolling = QTimer(tabs)
        self._scrolling.setInterval(SCROLL_MS)
        self._scrolling.timeout.connect(self._scroll)
        editor.block_carried.connect(self._carried)
        editor.block_dropped.connect(self._dropped)
        editor.blocks_brought.connect(self._brought)

    def _target(self, place: QPoint) -> str:
        """The tab there which can take blocks of this behaviour, by its key, or `NEW`; "" for none."""
        found = self._tabs.target_at(place)
        return found if found != self._session.document.key else ""

    def _carried(self, place: QPoint | None) -> None:
        self._held_at = place
        self._tabs.aim(self._target(place) if place is not None else "")
        if place is None:
            self._scrolling.stop()
        elif not self._scrolling.isActive():
            self._scrolling.start()

    def _scroll(self) -> None:
        place = self._held_at
        if place is not None and self._tabs.scroll_at(place):
            self._tabs.aim(self._target(place))
        else:
            self._scrolling.stop()  # what is moved from here on starts it again

    def _dropped(self, place: QPoint) -> None:
        target = self._target(place)
        self._held_at = None
        self._scrolling.stop()
        self._tabs.aim("")
        if not target:
            return
        self._from = self._session.document.key
        if target != NEW:
            self._context.run(f"tab:{target}")
            self._bring()
            return
        self._context.run("file.new")
        self._flush(self._bring)  # after its own flush, with which the new behaviour comes

    def _bring(self) -> None:
        if self._session.document.key != self._from:
            self._show()
            self._editor.bring_blocks()

    def _brought(self, count: int, how: str) -> None:
        document = self._session.document
        words = brought_words(count, how, self._session.documents.title(document))
        before = self._from

        def give_back() -> None:
            self._context.run(f"tab:{before}")
            self._editor.give_blocks_back()

        self._context.toast(words, _("Undo"), give_back)


def brought_words(count: int, how: str, name: str) -> str:
    """That so many blocks ("moved", "copied", "added") are in the behaviour of that name; 0: a note."""
    if not count:
        words = _("Moved the note to {name}") if how == "moved" else _("Copied the note to {name}")
    elif how == "moved":
        words = ngettext("Moved {count} block to {name}", "Moved {count} blocks to {name}", count)
    elif how == "copied":
        words = ngettext("Copied {count} block to {name}", "Copied {count} blocks to {name}", count)
    else:
        words = ngettext("Added {count} block to {name}", "Added {count} blocks to {name}", count)
    return words.format(count=count, name=name)
