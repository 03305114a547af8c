"""Disk image with the application, the Applications folder, and an arrow between them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from installers.context import APP, Context, PackageError, this_system

__all__ = ["APPLICATIONS_AT", "APP_AT", "ICON_SIDE", "VOLUME", "WINDOW", "dmg", "hfs_image", "settings"]

VOLUME = APP
WINDOW = (640, 400)
ICON_SIDE = 128
APP_AT, APPLICATIONS_AT = (170, 190), (470, 190)
_CORNER = (200, 120)


def settings(app: Path, background: Path, icon: Path) -> dict[str, Any]:
    """Return the settings for dmgbuild.

    An image next to ``background`` with @2x in its name is used for Retina screens.
    """
    return {
        "format": "ULMO",  # smallest format; macOS 10.15 and later open it
        "filesystem": "HFS+",
        "files": [(str(app), app.name)],
        "symlinks": {"Applications": "/Applications"},
        "hide_extensions": [app.name],
        "icon": str(icon),
        "background": str(background),
        "window_rect": (_CORNER, WINDOW),
        "icon_size": float(ICON_SIDE),
        "text_size": 13.0,
        "icon_locations": {app.name: APP_AT, "Applications": APPLICATIONS_AT},
    }


def dmg(target: Path, app: Path, background: Path, icon: Path) -> Path:
    """Create the disk image with hdiutil of macOS.

    Raises:
        PackageError: The image couldn't be created.
    """
    if this_system() != "macos":
        raise PackageError("a .dmg can be built on a Mac only: it needs hdiutil")
    import dmgbuild  # noqa: PLC0415  its import fails on other systems

    target.unlink(missing_ok=True)
    try:
        dmgbuild.build_dmg(str(target), VOLUME, settings=settings(app, background, icon))
    except dmgbuild.DMGError as error:
        raise PackageError(f"the disk image could not be created: {error}") from error
    return target


def hfs_image(context: Context, target: Path, app: Path, background: Path, icon: Path) -> Path:
    """Create a similar HFS+ image with xorrisofs on any system, for inspection only.

    The image isn't compressed, and the Finder doesn't show the background, because only a Mac can store
    its location.

    Raises:
        PackageError: The image couldn't be created.
    """
    from ds_store import DSStore  # noqa: PLC0415  part of dmgbuild, which is installed for packaging only

    image_folder = context.work / "image"
    shutil.rmtree(image_folder, ignore_errors=True)
    image_folder.mkdir(parents=True)
    shutil.copytree(app, image_folder / app.name, symlinks=True)
    (image_folder / "Applications").symlink_to("/Applications")
    shutil.copyfile(icon, image_folder / ".VolumeIcon.icns")
    shutil.copyfile(background, image_folder / f".background{background.suffix}")
    left, top = _CORNER
    width, height = WINDOW
    with DSStore.open(str(image_folder / ".DS_Store"), "w+") as store:
        store["."]["vSrn"] = ("long", 1)
        store["."]["icvl"] = ("type", b"icnv")
        store["."]["bwsp"] = {
            "WindowBounds": f"{{{{{left}, {top}}}, {{{width}, {height}}}}}",
            "ShowSidebar": False,
            "ShowToolbar": False,
            "ShowStatusBar": False,
        }
        store["."]["icvp"] = {
            "viewOptionsVersion": 1,
            "arrangeBy": "none",
            "backgroundType": 0,
            "iconSize": float(ICON_SIDE),
            "textSize": 13.0,
            "gridSpacing": 100.0,
            "labelOnBottom": True,
        }
        store[app.name]["Iloc"] = APP_AT
        store["Applications"]["Iloc"] = APPLICATIONS_AT
    target.unlink(missing_ok=True)
    context.run("xorrisofs", "-quiet", "-V", VOLUME, "-hfsplus", "-r", "-o", target, image_folder)
    return target
