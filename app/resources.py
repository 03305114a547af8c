"""Paths of the files that Studio ships: icons, fonts, examples, the web editor.

A checkout has them in ``resources/`` beside ``app/``, an installed or frozen Studio in ``app/_resources/``.
"""

from __future__ import annotations

from pathlib import Path


def folder() -> Path:
    """Return the folder that holds all resources."""
    package = Path(__file__).resolve().parent
    installed = package / "_resources"
    return installed if installed.is_dir() else package.parent / "resources"


def path(*parts: str) -> Path:
    """Return the path of a resource, such as ``path("icons", "play.svg")``.

    Raises FileNotFoundError if Studio doesn't ship it.
    """
    found = folder().joinpath(*parts)
    if not found.exists():
        raise FileNotFoundError(
            f"no resource '{'/'.join(parts)}' in '{folder()}'; is Studio installed completely?"
        )
    return found
