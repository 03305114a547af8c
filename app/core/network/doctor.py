"""The connection doctor beside the window: looks in a thread of its own, keeps what it found."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

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
        self, look: Callable[[], Sequence[doctor.Finding]], clock: Callable[[], float] = time.time
    ) -> None:
        """``look`` may take some seconds; ``clock`` gives epoch seconds."""
        self._look, self._clock = look, clock
        self._thread: threading.Thread | None = None
        self._found: tuple[doctor.Finding, ...] = ()
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
    def looked_s(self) -> float | None:
        """When it was found (epoch seconds); None before the first time."""
        return self._looked_s

    def look(self) -> None:
        """Look now; while it looks already, nothing."""
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
        try:
            found = tuple(self._look())
        except Exception as error:  # noqa: BLE001  a doctor that breaks off must say so, not vanish
            words = _("The doctor could not finish: {kind}: {error}.").format(
                kind=type(error).__name__, error=error
            )
            found = (doctor.Finding("doctor", "error", words, _("Tell the people who make NEP Studio.")),)
        self._found, self._looked_s = found, self._clock()
        self.revision += 1


def doctor_of(address: str, folder: Path) -> Doctor:
    """A doctor for the master at this address, who also looks at Studio's own folder."""
    folders = [(_("Settings and unsaved work"), folder)]
    return Doctor(lambda: doctor.findings(doctor.collect_facts(address, folders=folders)))
