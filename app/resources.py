"""Paths of the files shipped with Studio: icons, fonts, examples, the web editor.

In a checkout they are in ``resources/`` next to ``app/``, in an installed or frozen Studio in
``app/_resources/``.
"""

from __future__ import annotations

from pathlib import Path


def folder() -> Path:
    """Return the folder that contains all resources."""
    package = Path(__file__).resolve().parent
    installed = package / "_resources"
    return installed if installed.is_dir() else package.parent / "resources"


def path(*parts: str) -> Path:
    """Return the path of a resource, such as ``path("icons", "play.svg")``.

    Raises FileNotFoundError if there is no such resource.
    """
    resource = folder().joinpath(*parts)
    if not resource.exists():
        raise FileNotFoundError(
            f"no resource '{'/'.join(parts)}' in '{folder()}'; is Studio installed completely?"
        )
    return resource
