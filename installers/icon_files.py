"""Access to the painted icons, for which `icons.py` runs once with the interpreter that is frozen."""

from __future__ import annotations

from pathlib import Path

from installers.context import Context

__all__ = ["ICON_SIZES", "paint_icons"]

ICON_SIZES = (16, 22, 24, 32, 48, 64, 128, 256, 512)
"""Icon sizes in pixels for desktops; macOS also uses 1024."""


def paint_icons(context: Context) -> Path:
    """Return the folder with `nep-studio-SIZE.png` and `nep-behaviour-SIZE.png`, painting them if needed."""
    folder = context.work / "icons"
    if not folder.is_dir():
        context.work.mkdir(parents=True, exist_ok=True)
        context.run(*context.python, context.root / "installers" / "icons.py", folder, cwd=context.work)
    return folder
