"""The connection doctor beside the window: looks in a thread of its own, keeps what it found."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.network.topics import split_key
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.programs import doctor
else:
    doctor = lazy_module("nep.programs.doctor")

JOIN_S = 4.0


class Doctor:
    """Looks when it is asked. One thread uses it (the window's); the looking happens in another."""

    def __init__(
        self,
        look: Callable[[str, doctor.Tell], Sequence[doctor.Finding]],
        clock: Callable[[], float] = time.time,
    ) -> None:
        """``look`` gets the topic that is missed, and may take seconds; ``clock`` gives epoch seconds.

        Meanwhile it tells what is found so far, how many things it looked at, and of how many.
        """
        self._look, self._clock = look, clock
        self._thread: threading.Thread | None = None
        self._missed = self._told_of = ""
        self._found: tuple[doctor.Finding, ...] = ()
        self._so_far: tuple[doctor.Finding, ...] | None = None
        self.looked_at = self.things = 0
        """How many things were looked at, by the look that goes on or the last, and of how many."""
        self._looked_s: float | None = None
        self.revision = 0

    @property
    def looking(self) -> bool:
        """Whether it looks just now."""
        return self._thread is not None and self._thread.is_alive()

    @property
    def findings(self) -> Sequence[doctor.Finding]:
        """What was found last, the worst first."""
        return self._found

    @property
    def so_far(self) -> Sequence[doctor.Finding] | None:
        """What was found by a look that goes on, the worst first; None when none does."""
        return self._so_far

    @property
    def looked_s(self) -> float | None:
        """When it was found (epoch seconds); None before the first time."""
        return self._looked_s

    @property
    def missed(self) -> str:
        """The topic of which somebody sees nothing; "" for none in particular."""
        return self._missed

    @property
    def told_of(self) -> str:
        """The topic that was missed when `findings` were found."""
        return self._told_of

    def miss(self, topic: str) -> None:
        """Look for what is wrong with this topic, from now on; "" for none in particular."""
        self._missed = topic
        self.look()

    def look(self) -> None:
        """Look now; while it looks already, that goes on, with what is missed now."""
        if self.looking:
            return
        self._thread = threading.Thread(target=self._run, name="studio-doctor", daemon=True)
        self._thread.start()
        self.revision += 1

    def report(self, within_s: float) -> str:
        """What was found, as text to be given to somebody; waits for a look that goes on. For any thread."""
        thread = self._thread
        if thread is not None:
            thread.join(within_s)
        return doctor.report(self._found)

    def close(self) -> None:
        """Wait for a look that goes on."""
        if self._thread is not None:
            self._thread.join(JOIN_S)

    def _run(self) -> None:
        while True:  # whoever misses another topic meanwhile waits for that one
            missed, self._so_far = self._missed, None
            found = self._find(missed)
            if missed == self._missed:
                break
        self._found, self._looked_s, self._told_of = found, self._clock(), missed
        self._so_far = None
        self.revision += 1

    def _tell(self, found: tuple[doctor.Finding, ...], looked_at: int, things: int) -> None:
        self._so_far, self.looked_at, self.things = found, looked_at, things
        self.revision += 1

    def _find(self, missed: str) -> tuple[doctor.Finding, ...]:
        try:
            return tuple(self._look(missed, self._tell))
        except Exception as error:  # noqa: BLE001  a doctor that breaks off must say so, not vanish
            words = _("The doctor could not finish: {kind}: {error}.").format(
                kind=type(error).__name__, error=error
            )
            return (
                doctor.Finding("doctor", "error", words, _("Report it to the developers of NEP Studio.")),
            )


def doctor_of(address: str, folder: Path) -> Doctor:
    """A doctor for the master at this address, who also looks at Studio's own folder.

    What it knows of the topics of other networks it is not asked: it looks into Studio's own only.
    """
    folders = [(_("Settings and unsaved work"), folder)]
    return Doctor(lambda key, tell: doctor.look(address, "" if split_key(key)[0] else key, folders, tell))
