"""Writing a file so that a crash never leaves half of it."""

from __future__ import annotations

import contextlib
import glob
import os
import tempfile
import time
from pathlib import Path

LEFT_AFTER_S = 60.0


def write_atomically(path: Path, data: bytes, *, durable: bool = True) -> None:
    """Replace ``path`` by ``data``: readers see the old file or the new one, never a part.

    With ``durable`` the data are on the disk before the old file goes (a power cut leaves one of the two);
    without, only the death of this process is survived. Raises OSError, and then the old file is untouched.
    """
    if not data:
        raise ValueError("an empty file is never written over a full one")
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        _keep_mode(path, Path(name))
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    if durable:
        _sync_folder(path.parent)
        _sweep(path)


def _sweep(path: Path) -> None:
    """Take away what writers that were killed left beside the file; a write that goes on now is younger."""
    before = time.time() - LEFT_AFTER_S
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        with contextlib.suppress(OSError):  # somebody else was quicker, or it is not ours to take
            if part.stat().st_mtime < before:
                part.unlink()


def _keep_mode(old: Path, new: Path) -> None:
    # mkstemp makes files that only the owner may read; a behaviour is shared as its predecessor was.
    try:
        mode = old.stat().st_mode & 0o777
    except FileNotFoundError:
        mode = 0o644  # asking for the umask means changing it for every thread
    new.chmod(mode)


def _sync_folder(folder: Path) -> None:
    if os.name != "posix":
        return  # Windows can't open a folder, and its rename is journalled by the file system
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
