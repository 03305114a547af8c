"""The tabs from one start to the next: which behaviours were open, and what of them was not saved."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.core.documents.document import Document
from app.core.documents.journal import Unsaved
from app.core.documents.open_documents import Documents
from app.core.storage.settings import Settings
from app.errors import SettingsError

KEY = "tabs"


class KeptTabs:
    """Keeps in the settings which tabs are open, and opens them again at the next start."""

    def __init__(self, settings: Settings, documents: Documents, complain: Callable[[str], object]) -> None:
        """``complain`` is told, in a sentence, that they can't be kept."""
        self._settings, self._documents, self._complain = settings, documents, complain
        self.active = False
        """Whether this window is the one whose tabs come back; a second window's do not."""
        self._last: dict[str, object] = {}
        self._kept_revision = -1

    def come_back(self, left: Sequence[Unsaved]) -> list[Unsaved]:
        """Open the tabs of the last start, and keep them from now on.

        Of ``left``, the unsaved work that dead Studios left, those are returned for which a person is to be
        asked.
        """
        self.active = True
        kept: dict[str, object] = self._settings.get(KEY, {})
        self._last = kept
        taken = self._documents.put_back(kept, left, ended_well=kept.get("ended_well") is True)
        self.keep()
        return [each for each in left if each.journal not in taken]

    def recover(self, left: Sequence[Unsaved]) -> None:
        """Put unsaved work back into the tabs where it was; the one that was worked on shows."""
        newest_last = sorted(left, key=lambda each: each.edited_s)
        recovered = {each.journal.name: self._documents.recover(each) for each in newest_last}
        self._documents.arrange(self._last, recovered)
        self.keep()

    def edited(self, document: Document, *, was_blank: bool) -> None:
        """A person edited a behaviour: from its first block on its tab comes back, too."""
        if was_blank and not document.blank:
            self.keep()

    def follow(self) -> None:
        """Keep which tab shows, if that changed. Once a second: nobody waits for the disk to see a tab."""
        if self._documents.revision != self._kept_revision:
            self.keep()

    def keep(self, *, ended_well: bool = False) -> None:
        """Keep which tabs are open now; ``ended_well`` when the window closes in order."""
        if not self.active:
            return
        self._kept_revision = self._documents.revision
        try:
            self._settings.set(KEY, {**self._documents.kept(), "ended_well": ended_well})
        except SettingsError as error:
            self._complain(str(error))
