"""Where the painted icons are: `icons.py` is run once by the interpreter that is frozen."""

from __future__ import annotations

from pathlib import Path

from installers.context import Context

__all__ = ["ICON_SIZES", "paint_icons"]

ICON_SIZES = (16, 22, 24, 32, 48, 64, 128, 256, 512)
"""Those of a desktop; macOS takes 1024 as well."""


def paint_icons(context: Context) -> Path:
    """The folder with `nep-studio-SIZE.png` and `nep-behaviour-SIZE.png`."""
    folder = context.work / "icons"
    if not folder.is_dir():
        context.work.mkdir(parents=True, exist_ok=True)
        context.run(*context.python, context.root / "installers" / "icons.py", folder, cwd=context.work)
    return folder
