"""Packages for Windows: `NEP-Studio-VERSION-setup.exe` and a portable zip.

On Windows the packages are built with the Python that runs the packer, on Linux with a Windows Python
in Wine.
"""

from __future__ import annotations

import os
import sys
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

from installers.context import APP, Context, PackageError
from installers.freeze import add_licences, freeze
from installers.icon_files import paint_icons
from installers.windows.icon import write_icon
from installers.windows.nsis import BEHAVIOUR_ICON, make_setup
from installers.windows.version import version_resource

__all__ = ["build", "make_zip", "reject_wine_files"]

WINE_SIGNATURES = (b"Wine builtin DLL", b"Wine placeholder DLL")
MIN_ZIP_TIME = 315_532_800
"""Earliest timestamp of a zip entry, 1 January 1980, in seconds since 1970."""


def build(context: Context, *, keep_frozen: bool) -> Sequence[Path]:
    """Build the installer, the zip and the bill of materials, and return their paths.

    Args:
        context: Version and folders.
        keep_frozen: True to reuse the frozen program of an earlier build.

    Raises:
        PackageError: A step has failed.
    """
    host = replace(context, python=(sys.executable,))
    painted = paint_icons(host)
    icon = write_icon(painted, "nep-studio", context.work / "nep-studio.ico")
    picture = context.work / "page.bmp"
    host.run(sys.executable, context.root / "installers" / "windows" / "page_picture.py", picture)
    if sys.platform != "win32":
        from installers.windows.wine import windows_python  # noqa: PLC0415  not needed on Windows

        context = replace(context, python=windows_python(context))
    if not (keep_frozen and context.frozen.is_dir()):
        version = context.work / "version.txt"
        version.write_text(version_resource(context.version), "utf-8")
        os.environ.update(NEP_PACKAGE_ICON=str(icon), NEP_PACKAGE_VERSION_FILE=str(version))
        freeze(context)
    write_icon(painted, "nep-behaviour", context.frozen / BEHAVIOUR_ICON)
    bill = add_licences(context, context.frozen, context.frozen)
    reject_wine_files(context.frozen)
    set_timestamps(context.frozen, context.epoch)
    return [make_setup(context, icon, picture), make_zip(context), bill]


def reject_wine_files(frozen: Path) -> None:
    """Raise `PackageError` if the package contains libraries of Wine.

    Windows would load these libraries instead of its own.
    """
    names = [
        path.name
        for path in _files(frozen)
        if path.suffix.lower() in {".dll", ".exe"} and _is_wine_file(path)
    ]
    if names:
        raise PackageError(f"the package would contain files of Wine: {', '.join(sorted(names))}")


def _is_wine_file(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(0x80)[0x40:].startswith(WINE_SIGNATURES)


def set_timestamps(frozen: Path, epoch: int) -> None:
    """Set the timestamp of all files to `epoch` (seconds since 1970), so that packages are reproducible."""
    for path in _files(frozen):
        os.utime(path, (epoch, epoch))


def _files(frozen: Path) -> Iterator[Path]:
    return (path for path in sorted(frozen.rglob("*")) if path.is_file())


def make_zip(context: Context) -> Path:
    """Create the zip of the frozen Studio, with sorted entries and a single timestamp."""
    target = context.dist / f"NEP-Studio-{context.version}-windows-x64.zip"
    target.parent.mkdir(exist_ok=True)
    moment = datetime.fromtimestamp(max(context.epoch, MIN_ZIP_TIME), timezone.utc).timetuple()[:6]
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path in _files(context.frozen):
            entry = zipfile.ZipInfo(f"{APP}/{path.relative_to(context.frozen).as_posix()}", moment)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 0  # as on Windows, for reproducibility
            archive.writestr(entry, path.read_bytes())
    return target
