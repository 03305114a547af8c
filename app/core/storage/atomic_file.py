"""Atomic writing and safe reading of files.

Files that concern only the user (settings, unsaved work, versions) are private, regardless of the
umask.
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

STALE_PART_AGE_S = 60.0
MAX_BYTES = 10_000_000
"""Maximum size of a file that is read into memory, in bytes."""
_PRIVATE_FOLDER_MODE, _OTHERS_PERMISSIONS = 0o700, 0o077


def read_regular_file(path: Path, max_bytes: int = MAX_BYTES) -> bytes:
    """Return the content of a regular file.

    Never blocks on a pipe, a device, a folder, or a link to one of these.

    Args:
        path: Path of the file.
        max_bytes: Maximum size in bytes.

    Raises:
        OSError: The file can't be read, is not a regular file or is too large; ``strerror`` is the
            reason.
    """
    # Without NONBLOCK, opening a pipe waits for its writer forever.
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        file_stat = os.fstat(descriptor)
        if not stat.S_ISREG(file_stat.st_mode):
            raise OSError(errno.EINVAL, _("not a file, but a folder, a pipe or a device"), str(path))
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            data = file.read(max_bytes + 1) if file_stat.st_size <= max_bytes else b""
    finally:
        os.close(descriptor)
    if file_stat.st_size > max_bytes or len(data) > max_bytes:
        size, limit_mb = max(file_stat.st_size, len(data)) / 1e6, max_bytes / 1e6
        raise OSError(
            errno.EFBIG,
            _("the file is {size} MB; the limit is {most} MB").format(
                size=number(size, ".1f"), most=number(limit_mb, ".0f")
            ),
            str(path),
        )
    return data


def write_atomically(
    path: Path, data: bytes | Iterable[bytes], *, durable: bool = True, private: bool = False
) -> None:
    """Replace the content of a file. Readers see the old or the new content, never a part of it.

    Args:
        path: Path of the file; its folder is created if necessary.
        data: Content, or an iterable of its parts, so that a large file need not fit into memory. An
            exception of the iterable cancels the write.
        durable: True to flush the data to disk before the old file is replaced, so that the old or the
            new content survives a power failure. If False, it survives only a crash of this process.
        private: True to make the file, and a folder that is created, accessible only to their owner.

    Raises:
        OSError: The file can't be written. The old file is unchanged.
        ValueError: ``data`` is empty bytes.
    """
    if isinstance(data, bytes) and not data:
        raise ValueError("an empty file is never written over a full one")
    if private:
        create_private_folder(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".part", dir=path.parent)
    try:
        with os.fdopen(descriptor, "wb") as file:
            file.writelines((data,) if isinstance(data, bytes) else data)
            file.flush()
            if durable:
                os.fsync(file.fileno())
        if not private:  # mkstemp creates private files
            _copy_mode(path, Path(name))
        replace_file(Path(name), path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    if durable:
        _sync_folder(path.parent)
        _remove_stale_parts(path)


def _remove_stale_parts(path: Path) -> None:
    # Removes parts left by killed writers; writes in progress are younger.
    max_mtime_s = time.time() - STALE_PART_AGE_S
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        with contextlib.suppress(OSError):  # removed by another process, or not permitted
            if part.stat().st_mtime < max_mtime_s:
                part.unlink()


def create_private_folder(folder: Path) -> None:
    """Create a folder if necessary, and make it accessible only to its owner.

    Folders of other users are not changed. On Windows nothing is changed, because user folders are
    already private. Raises OSError if the folder can't be created.
    """
    folder.mkdir(mode=_PRIVATE_FOLDER_MODE, parents=True, exist_ok=True)
    _restrict_to_owner(folder)


def make_private(folder: Path, files: str) -> None:
    """Make a folder and files in it private, because earlier versions of Studio did not.

    Args:
        folder: Path of the folder.
        files: Glob pattern of the files.
    """
    if os.name != "posix" or not folder.is_dir():
        return
    _restrict_to_owner(folder)
    with contextlib.suppress(OSError):
        for file in folder.glob(files):
            if file.is_file() and not file.is_symlink():
                _restrict_to_owner(file)


def _restrict_to_owner(path: Path) -> None:
    if os.name != "posix":
        return
    with contextlib.suppress(OSError):  # another user's, or a file system without modes
        mode = stat.S_IMODE(path.stat().st_mode)
        if mode & _OTHERS_PERMISSIONS:
            path.chmod(mode & ~_OTHERS_PERMISSIONS)


def _copy_mode(old: Path, new: Path) -> None:
    # A behaviour stays shared as the replaced file was.
    try:
        mode = old.stat().st_mode & 0o777
    except FileNotFoundError:
        mode = _default_mode(new)
    new.chmod(mode)


def _default_mode(sibling: Path) -> int:
    # Determined by creating a file: reading the umask would change it for all threads.
    probe = sibling.with_name(f"{sibling.stem}.mode.part")  # removed with the others after a crash
    os.close(os.open(probe, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    try:
        return stat.S_IMODE(probe.stat().st_mode)
    finally:
        probe.unlink()


def _sync_folder(folder: Path) -> None:
    if os.name != "posix":
        return  # Windows can't open a folder; its rename is journalled by the file system
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
