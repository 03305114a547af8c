"""Where the files are that Studio ships: icons, fonts, examples, the web editor.

In a checkout they are in ``resources/`` beside ``app/``, in an installed or frozen Studio in
``app/_resources/``.
"""

from __future__ import annotations

from pathlib import Path


def folder() -> Path:
    """The folder that holds all resources."""
    package = Path(__file__).resolve().parent
    installed = package / "_resources"
    return installed if installed.is_dir() else package.parent / "resources"


def path(*parts: str) -> Path:
    """One resource, such as ``path("icons", "play.svg")``; FileNotFoundError if Studio does not ship it."""
    found = folder().joinpath(*parts)
    if not found.exists():
        raise FileNotFoundError(
            f"no resource '{'/'.join(parts)}' in '{folder()}'; is Studio installed completely?"
        )
    return found
