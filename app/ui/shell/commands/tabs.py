"""What the commands about the open behaviours do: to the next tab, close, open again; and their come-back."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.core.documents.document import Document
from app.core.documents.journal import Unsaved
from app.core.session import Session
from app.ui.shell.actions.table import Handler
from app.ui.shell.bars.banner import BannerPlace
from app.ui.shell.documents.controller import Files


class Tabs:
    """Gives the table's commands about tabs their handlers."""

    def __init__(self, session: Session, files: Files, show: Callable[[], object]) -> None:
        """``show`` brings the behaviours into view."""
        self._session, self._files, self._show = session, files, show

    def handlers(self) -> dict[str, Handler]:
        """By the names of the table."""
        files, session = self._files, self._session
        return {
            "tab.next": lambda: self._step(1),
            "tab.previous": lambda: self._step(-1),
            "tab.close": lambda: files.close(session.document),
            "tab.reopen": files.reopen,
        }

    def asked(self) -> dict[str, Callable[[str], object]]:
        """Those that name a tab: ``tab:KEY`` shows it, ``tab.move:KEY:2`` puts it to the third place."""
        return {
            "tab": lambda key: self._with(key, self._files.show),
            "tab.close": lambda key: self._with(key, self._files.close),
            "tab.close_others": lambda key: self._with(key, self._close_others),
            "tab.save_as": lambda key: self._with(key, self._save_as),
            "tab.move": self._move,
        }

    def _with(self, key: str, act: Callable[[Document], object]) -> None:
        document = self._session.documents.with_key(key)
        if document is not None:
            act(document)

    def _step(self, step: int) -> None:
        self._files.show(self._session.documents.neighbour(step))
        self._show()

    def _close_others(self, document: Document) -> None:
        self._files.close(*(other for other in self._session.documents if other is not document))

    def _save_as(self, document: Document) -> None:
        self._files.show(document)
        self._files.save_as()

    def _move(self, argument: str) -> None:
        key, _, place = argument.rpartition(":")
        if place.isdigit():
            self._with(key, lambda document: self._files.move(document, int(place)))

    # -- at the start -----------------------------------------------------------------------------

    def come_back(self, left: Sequence[Unsaved], banner: BannerPlace) -> None:
        """Open the tabs of the last start; offer what a Studio that died left behind."""
        rest = self._session.tabs.come_back(left)
        if not rest:
            return

        def throw_away() -> None:
            for unsaved in rest:
                unsaved.journal.unlink(missing_ok=True)

        banner.offer(
            "Put back the unsaved work?",
            unsaved_words(rest),
            ("Put it back", lambda: self._files.recover(rest)),
            ("Throw it away", throw_away),
        )


def unsaved_words(left: Sequence[Unsaved]) -> str:
    """Which behaviours were not saved."""
    first = f"“{left[0].name}”"
    if len(left) == 1:
        return f"{first} was not saved when Studio ended last time."
    others = f"“{left[1].name}”" if len(left) == 2 else f"{len(left) - 1} others"
    return f"{first} and {others} were not saved when Studio ended last time."
