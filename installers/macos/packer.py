"""Package for macOS: `NEP-Studio-VERSION-macos-ARCH.dmg` with the application."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from installers.context import APP, Context, PackageError, this_system
from installers.freeze import add_licences, freeze
from installers.macos import disk_image, layout, signing
from installers.macos.film_libraries import remove_ffmpeg
from installers.macos.information import APP_ICON, DOCUMENT_ICON, write_info_plist, write_localised_texts

__all__ = ["application", "build", "finish", "pack", "prepare"]

_BACKGROUND = "background.png"

MakeImage = Callable[[Path, Path, Path, Path], Path]
"""Function that creates a disk image, its first argument, from an application, a background and an icon."""


def application(context: Context) -> Path:
    """Return the application bundle created by PyInstaller."""
    return context.frozen.with_name(f"{APP}.app")


def prepare(context: Context) -> Mapping[str, str]:
    """Create the files needed for freezing; return environment variables for PyInstaller's specification.

    Raises:
        PackageError: A step has failed.
    """
    pictures = _pictures(context)
    pictures.mkdir(parents=True, exist_ok=True)
    context.run(*context.python, "-m", "installers.macos.pictures", pictures)
    information = write_info_plist(context.work / "Info.plist", context.version, context.machine)
    return {
        "NEP_PACKAGE_ICON": str(pictures / APP_ICON),
        "NEP_PACKAGE_INFO_PLIST": str(information),
    }


def build(context: Context, *, keep_frozen: bool) -> Sequence[Path]:
    """Build the disk image and the bill of materials; sign and notarise the image as configured.

    Args:
        context: Version and folders.
        keep_frozen: True to reuse the application of an earlier build.

    Raises:
        PackageError: A step has failed, or this isn't a Mac.
    """
    if this_system() != "macos":
        raise PackageError(
            "the package for macOS can be built on a Mac only: "
            "PyInstaller freezes for the system that it runs on"
        )
    return pack(context, signing.identity_of(os.environ), disk_image.dmg, keep_frozen=keep_frozen)


def pack(
    context: Context, identity: signing.Identity, make_image: MakeImage, *, keep_frozen: bool
) -> Sequence[Path]:
    """Build the disk image and the bill of materials with the given identity.

    Args:
        context: Version and folders.
        identity: Signing identity.
        make_image: Creates the disk image.
        keep_frozen: True to reuse the application of an earlier build.

    Raises:
        PackageError: A step has failed.
    """
    os.environ.update(prepare(context))  # read by the specification
    app = application(context)
    if not (keep_frozen and app.is_dir()):
        freeze(context)
        remove_ffmpeg(context, app)
    context.dist.mkdir(parents=True, exist_ok=True)
    bill = add_licences(context, app, app / "Contents" / "Resources")
    finish(context, app, identity)
    pictures = _pictures(context)
    target = context.dist / f"NEP-Studio-{context.version}-macos-{context.machine}.dmg"
    make_image(target, app, pictures / _BACKGROUND, pictures / APP_ICON)
    signing.sign_image(context, target, identity)
    if identity.notary:
        signing.notarise(context, target, identity)
        signing.assess(context, target)
    return [target, bill]


def finish(context: Context, app: Path, identity: signing.Identity) -> None:
    """Complete a frozen application, check it, sign it, and have it notarised.

    Steps for which no identity is configured are skipped with a printed message.

    Raises:
        PackageError: A step has failed.
    """
    if not app.is_dir():
        raise PackageError(f"the frozen application is not in '{app}'")
    resources = app / "Contents" / "Resources"
    shutil.copyfile(_pictures(context) / DOCUMENT_ICON, resources / DOCUMENT_ICON)
    write_localised_texts(resources)
    if problems := layout.check(app, context.version, context.machine):
        raise PackageError(f"'{app.name}' violates rules of macOS:\n  " + "\n  ".join(problems))
    newer = layout.binaries_for_newer_macos(app, context.machine)
    if newer:
        _print_step(
            f"{len(newer)} libraries are built for macOS {max(newer.values())}; test on the oldest macOS"
        )
    signing.sign(context, app, identity)
    signing.verify(context, app)
    if identity.notary:
        signing.notarise(context, app, identity)
        signing.assess(context, app)
    elif identity.is_known:
        _print_step("notarisation skipped: NEP_MACOS_NOTARY_PROFILE is not set (installers/README.md)")
    else:
        _print_step("signing and notarisation skipped: NEP_MACOS_IDENTITY is not set (installers/README.md)")


def _pictures(context: Context) -> Path:
    return context.work / "pictures"


def _print_step(line: str) -> None:
    sys.stdout.write(f"· {line}\n")
    sys.stdout.flush()
