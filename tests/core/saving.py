"""Process that saves a behaviour repeatedly and is killed while it saves, for `test_bad_files`.

Each line of the input is one run: the number of saves, and the milliseconds from then to the kill. A
child process saves in a loop until it is killed with signal 9. Then one line is printed about the
content of the file: "whole N", or the error.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from pathlib import Path

from app.core.projects.file_format import read_file
from app.core.projects.journal import Journal
from app.core.projects.open_project import OpenProject
from app.errors import DocumentError


def blocks(number: int) -> dict[str, object]:
    """Return a behaviour whose size depends on ``number``, so that a truncated file is never a valid one."""
    tops = [{"type": "events_started", "id": f"{number}-{each}"} for each in range(1 + number * 37 % 400)]
    return {"blocks": {"languageVersion": 0, "blocks": tops}}


def save_for_ever(path: Path, journals: Path, begin: int, saved: int) -> None:
    document = OpenProject(lambda: Journal(journals))
    if path.exists():
        document.open(path)
    number = begin
    while True:
        number += 1
        document.apply_edit(blocks(number))
        document.save(path)
        os.write(saved, b"s")


def look(path: Path) -> str:
    try:
        return f"whole {len(read_file(path).always.workspace.blocks['blocks']['blocks'])}"  # type: ignore[index,call-overload]
    except FileNotFoundError:
        return "none yet"
    except DocumentError as error:
        return f"none yet: {error}" if not path.exists() else str(error)


def main(path: Path, journals: Path) -> None:
    for life, line in enumerate(sys.stdin):
        saves, last_ms = map(int, line.split())
        reading, saved = os.pipe()
        child = os.fork()
        if child == 0:
            save_for_ever(path, journals, life * 1000, saved)
        for _ in range(saves):  # waits for each save, because a busy computer may be slow
            os.read(reading, 1)
        threading.Event().wait(last_ms / 1000)
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(reading)
        os.close(saved)
        sys.stdout.write(look(path) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
