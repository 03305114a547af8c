"""Freezing of Studio and its dependencies into a folder that runs without Python."""

from __future__ import annotations

import shutil
from pathlib import Path

from installers.context import Context, PackageError

__all__ = ["add_licences", "freeze"]


def freeze(context: Context) -> Path:
    """Freeze Studio and return the folder with the frozen program.

    Studio must be installed for `context.python`, and not as an editable checkout, so that the result
    contains the same files as an installation. On macOS the application bundle is next to the folder.

    Raises:
        PackageError: Freezing has failed.
    """
    shutil.rmtree(context.work / "dist", ignore_errors=True)
    context.work.mkdir(parents=True, exist_ok=True)
    context.run(
        *context.python, "-m", "PyInstaller", "--noconfirm", "--clean", "--log-level", "WARN",
        "--distpath", context.work / "dist", "--workpath", context.work / "build",
        context.root / "installers" / "nep-studio.spec",
        cwd=context.work,  # not the checkout, whose modules Python would import first
    )  # fmt: skip
    if not context.frozen.is_dir():
        raise PackageError(f"the frozen program is not in '{context.frozen}'")
    return context.frozen


def add_licences(context: Context, program_folder: Path, folder: Path) -> Path:
    """Write licence texts, notice and bill of materials of a frozen program; return the bill of materials.

    Args:
        context: Version and folders; the bill of materials is written to `dist`.
        program_folder: Folder of the frozen program.
        folder: Folder for licence texts and notice.

    Raises:
        PackageError: A part has no known licence, or writing has failed.
    """
    # A release has one file per system, and two for macOS.
    platform_tag = f"macos-{context.machine}" if context.system == "macos" else context.system
    bill = context.dist / f"NEP-Studio-{context.version}-{platform_tag}.cdx.json"
    inventory = context.root / "installers" / "inventory" / "__main__.py"
    context.run(
        *context.python,
        inventory,
        context.system,
        str(context.epoch),
        program_folder,
        folder,
        bill,
        cwd=context.work,
    )
    return bill
