"""Removal of shared libraries that are no longer needed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = ["remove_dead_links", "remove_unneeded", "size_of"]


def size_of(folder: Path) -> int:
    """Return the total size in bytes of the files in a folder, without subfolders."""
    return sum(path.stat().st_size for path in folder.iterdir())


def remove_unneeded(folder: Path, users: Iterable[Path], needed_by: Callable[[Path], Iterable[str]]) -> None:
    """Remove the libraries of a folder that no file in `users` needs directly or indirectly.

    Args:
        folder: Folder of the libraries.
        users: Binaries that may be linked with the libraries.
        needed_by: Returns the names of the libraries that a file is linked with.
    """
    unchecked, needed = list(users), set[str]()
    while unchecked:
        for name in needed_by(unchecked.pop()):
            if name not in needed and (folder / name).is_file():
                needed.add(name)
                unchecked.append(folder / name)
    for path in folder.iterdir():
        if path.name not in needed:
            path.unlink()


def remove_dead_links(links: Iterable[Path]) -> None:
    """Remove those of the given links whose target doesn't exist any more.

    PyInstaller creates links to libraries in other folders.
    """
    for link in links:
        if link.is_symlink() and not link.exists():
            link.unlink()
