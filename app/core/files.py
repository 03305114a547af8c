"""Writing a file so that a crash never leaves half of it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path


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
