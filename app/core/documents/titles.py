"""What people call behaviours: by their files' names, and two of the same name with their folders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.core.storage.settings import RecentFile, kept_folder
from nep.i18n import _


def name_of(path: Path, inside: str) -> str:
    """What a file is called: its own name; ``inside`` is the name written in it.

    That counts only in Studio's own folder of work that was closed unsaved: nobody chose a file's name there.
    """
    return inside if path.parent == kept_folder() else path.stem


def told_apart(named: Sequence[tuple[str, Path | None]]) -> list[str]:
    """A title for each of these names and files: the name, with as many folders as it takes."""
    alike: dict[str, set[Path]] = {}
    for name, path in named:
        if path is not None:
            alike.setdefault(name.casefold(), set()).add(path)
    counts: dict[str, int] = {}
    for name, _path in named:
        counts[name.casefold()] = counts.get(name.casefold(), 0) + 1
    titles = []
    for name, path in named:
        title = name
        if path is not None and counts[name.casefold()] > 1:
            folder = _folder(path, alike[name.casefold()] - {path})
            title = _("{name} — {folder}").format(name=name, folder=folder) if folder else name
        titles.append(title)
    return titles


def recent_titles(files: Sequence[RecentFile]) -> list[RecentFile]:
    """The same files, called so that no two of them have the same name."""
    titles = told_apart([(file.name, file.path) for file in files])
    return [replace(file, name=title) for file, title in zip(files, titles, strict=True)]


def _folder(path: Path, others: set[Path]) -> str:
    """The folders that hold the file, as few as tell it from the others."""
    folders = path.parent.parts[1:] or path.parent.parts
    for count in range(1, len(folders)):
        if all(other.parent.parts[-count:] != folders[-count:] for other in others):
            return "/".join(folders[-count:])
    return "/".join(folders)
