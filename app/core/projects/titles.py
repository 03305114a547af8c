"""Titles of behaviours: file names, followed by parent folders if several names are equal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from app.core.storage.folders import closed_tabs_folder
from app.core.storage.settings import RecentFile
from nep.i18n import _


def name_of(path: Path, stored_name: str) -> str:
    """Return the display name of a behaviour file.

    This is the file name. In Studio's folder of behaviours that were closed without saving, where file
    names are generated, it is ``stored_name``.

    Args:
        path: Path of the file.
        stored_name: Name stored in the file.
    """
    return stored_name if path.parent == closed_tabs_folder() else path.stem


def unique_titles(named_paths: Sequence[tuple[str, Path | None]]) -> list[str]:
    """Return a title for each pair of name and file; titles of different files differ.

    A title is the name, followed by as many parent folders as are needed to distinguish equal names.
    """
    paths_by_name: dict[str, set[Path]] = {}
    for name, path in named_paths:
        if path is not None:
            paths_by_name.setdefault(name.casefold(), set()).add(path)
    counts: dict[str, int] = {}
    for name, _path in named_paths:
        counts[name.casefold()] = counts.get(name.casefold(), 0) + 1
    titles = []
    for name, path in named_paths:
        title = name
        if path is not None and counts[name.casefold()] > 1:
            folder = _distinguishing_folder(path, paths_by_name[name.casefold()] - {path})
            title = _("{name} — {folder}").format(name=name, folder=folder) if folder else name
        titles.append(title)
    return titles


def recent_titles(files: Sequence[RecentFile]) -> list[RecentFile]:
    """Return recent files with their names replaced by unique titles."""
    titles = unique_titles([(file.name, file.path) for file in files])
    return [replace(file, name=title) for file, title in zip(files, titles, strict=True)]


def _distinguishing_folder(path: Path, other_paths: set[Path]) -> str:
    # As few folders as distinguish the file from the others.
    folders = path.parent.parts[1:] or path.parent.parts
    for count in range(1, len(folders)):
        if all(other.parent.parts[-count:] != folders[-count:] for other in other_paths):
            return "/".join(folders[-count:])
    return "/".join(folders)
