"""Freezing: Studio and all that it needs, as a folder that runs without a Python."""

from __future__ import annotations

import shutil
from pathlib import Path

from installers.context import Context, PackageError

__all__ = ["add_licences", "freeze"]


def freeze(context: Context) -> Path:
    """The folder with the frozen program. Raises `PackageError`.

    `context.python` is asked, in whose environment Studio is installed and not only checked out: what is
    frozen is what a user would install. On macOS the application's bundle is beside the folder.
    """
    shutil.rmtree(context.work / "dist", ignore_errors=True)
    context.work.mkdir(parents=True, exist_ok=True)
    context.run(
        *context.python, "-m", "PyInstaller", "--noconfirm", "--clean", "--log-level", "WARN",
        "--distpath", context.work / "dist", "--workpath", context.work / "build",
        context.root / "installers" / "nep-studio.spec",
        cwd=context.work,  # not the checkout, whose modules Python would find first
    )  # fmt: skip
    if not context.frozen.is_dir():
        raise PackageError(f"the frozen program is not in '{context.frozen}'")
    return context.frozen


def add_licences(context: Context, inside: Path, folder: Path) -> Path:
    """Put the licence texts and the notice of what is `inside` into a folder; the bill, in `dist`.

    Raises `PackageError`, also when something is inside of which nobody knows the licence.
    """
    # A release has one of each, and two for macOS.
    of = f"macos-{context.machine}" if context.system == "macos" else context.system
    bill = context.dist / f"NEP-Studio-{context.version}-{of}.cdx.json"
    inventory = context.root / "installers" / "inventory" / "__main__.py"
    context.run(
        *context.python, inventory, context.system, str(context.epoch), inside, folder, bill, cwd=context.work
    )
    return bill
