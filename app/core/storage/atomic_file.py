"""Files of Studio's own: written so that a crash never leaves half of them, read only when they are files.

What only concerns its user (settings, unsaved work, versions) is for nobody else to read, whatever the umask.
"""

from __future__ import annotations

import contextlib
import errno
import glob
import os
import stat
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

from nep.i18n import _, number
from nep.system.replace_file import replace_file

LEFT_AFTER_S = 60.0
LARGEST_BYTES = 10_000_000
"""What is larger is not read into memory."""
_PRIVATE_FOLDER, _OTHERS = 0o700, 0o077


def read_whole(path: Path, most_bytes: int = LARGEST_BYTES) -> bytes:
    """A regular file of at most so many bytes. Raises OSError for all else, with the reason in ``strerror``.

    What only looks like a file (a pipe, a device, a folder, a link to one) is never waited for.
    """
    # Without NONBLOCK the opening of a pipe waits for its writer, for ever.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        about = os.fstat(handle)
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, _("it is a folder, a pipe or a device, not a file"), str(path))
        with os.fdopen(handle, "rb", closefd=False) as file:
            data = file.read(most_bytes + 1) if about.st_size <= most_bytes else b""
    finally:
        os.close(handle)
    if about.st_size > most_bytes or len(data) > most_bytes:
        size, most = max(about.st_size, len(data)) / 1e6, most_bytes / 1e6
        raise OSError(
            errno.EFBIG,
            _("it has {size} MB; the limit is {most} MB").format(
                size=number(size, ".1f"), most=number(most, ".0f")
            ),
            str(path),
        )
    return data


def write_atomically(
    path: Path, data: bytes | Iterable[bytes], *, durable: bool = True, private: bool = False
) -> None:
    """Replace ``path`` by ``data``: readers see the old file or the new one, never a part.

    With ``durable`` the data are on the disk before the old file goes (a power cut leaves one of the two);
    without, only the death of this process is survived. A ``private`` file is for its owner only, and so is a
    folder that is made for it. Raises OSError, and then the old file is untouched.

    ``data`` may come in parts, so that no large file is whole in memory; what they raise ends the writing.
    """
    if isinstance(data, bytes) and not data:
        raise ValueError("an empty file is never written over a full one")
    if private:
        private_folder(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines((data,) if isinstance(data, bytes) else data)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        if not private:  # mkstemp makes files that only the owner may read
            _keep_mode(path, Path(name))
        replace_file(Path(name), path)
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


def private_folder(folder: Path) -> None:
    """Make the folder if it is not there, and let only its owner into it. Raises OSError if it can't be made.

    One that is another's stays as it is, and so does Windows, where a person's folders are private already.
    """
    folder.mkdir(mode=_PRIVATE_FOLDER, parents=True, exist_ok=True)
    _close_to_others(folder)


def make_private(folder: Path, files: str) -> None:
    """Let only the owner into a folder and at those files in it (a pattern), as earlier versions did not."""
    if os.name != "posix" or not folder.is_dir():
        return
    _close_to_others(folder)
    with contextlib.suppress(OSError):
        for file in folder.glob(files):
            if file.is_file() and not file.is_symlink():
                _close_to_others(file)


def _close_to_others(path: Path) -> None:
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # another's, or a disk without modes: as private as it can be
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & _OTHERS:
            path.chmod(mode & ~_OTHERS)


def _keep_mode(old: Path, new: Path) -> None:
    # A behaviour is shared as its predecessor was.
    try:
        mode = old.stat().st_mode & 0o777
    except FileNotFoundError:
        mode = _mode_of_new_files(new)
    new.chmod(mode)


def _mode_of_new_files(beside: Path) -> int:
    """What the umask leaves of a new file, learnt by making one: to ask is to change it for every thread."""
    probe = beside.with_name(f"{beside.stem}.mode.part")  # swept away with the others after a crash
    os.close(os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        return stat.S_IMODE(probe.stat().st_mode)
    finally:
        probe.unlink()


def _sync_folder(folder: Path) -> None:
    if os.name != "posix":
        return  # Windows can't open a folder, and its rename is journalled by the file system
    handle = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
