"""What is left of a folder of shared libraries when some of them are not needed any more."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

__all__ = ["remove_dead_links", "remove_unneeded", "size_of"]


def size_of(folder: Path) -> int:
    """The bytes of the files in a folder, without those of the folders in it."""
    return sum(path.stat().st_size for path in folder.iterdir())


def remove_unneeded(folder: Path, users: Iterable[Path], needed_by: Callable[[Path], Iterable[str]]) -> None:
    """Remove the libraries of a folder that no program of `users` needs, neither itself nor through others.

    ``needed_by`` tells the names of the libraries that a file is linked with.
    """
    waiting, kept = list(users), set[str]()
    while waiting:
        for name in needed_by(waiting.pop()):
            if name not in kept and (folder / name).is_file():
                kept.add(name)
                waiting.append(folder / name)
    for path in folder.iterdir():
        if path.name not in kept:
            path.unlink()


def remove_dead_links(links: Iterable[Path]) -> None:
    """Remove those that point to nothing now: PyInstaller links libraries into other folders."""
    for link in links:
        if link.is_symlink() and not link.exists():
            link.unlink()
