"""The end of the process, when the window is closed and everything of Studio's own has ended.

Python waits for every thread that is no daemon: one of a plug-in that never ends, or one that writes to a
disk which does not answer, would leave a process without a window for ever.
"""

from __future__ import annotations

import logging
import os
import threading
import time

from nep.system.streams import close_streams

GRACE_S = 5.0

_log = logging.getLogger("studio")


def still_running(within_s: float) -> tuple[str, ...]:
    """The names of the threads for which Python would wait, and which do not end within that time."""
    until = time.monotonic() + within_s
    others = [
        each
        for each in threading.enumerate()
        if not each.daemon and each is not threading.current_thread() and each is not threading.main_thread()
    ]
    for each in others:
        each.join(max(0.0, until - time.monotonic()))
    return tuple(each.name for each in others if each.is_alive())


def end_process(code: int, within_s: float = GRACE_S) -> int:
    """``code`` when all threads have ended; else the log says which has not, and the process ends here."""
    left = still_running(within_s)
    if not left:
        return code
    _log.error("Studio ends without %s, which goes on", ", ".join(f"'{name}'" for name in left))
    logging.shutdown()
    close_streams()
    os._exit(code)
