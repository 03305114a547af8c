"""Tests of the disk image's window: the settings for dmgbuild, and the window read back from an image."""

from __future__ import annotations

import shutil
import subprocess
from importlib.util import find_spec
from pathlib import Path

import pytest

from installers.context import PackageError, this_system
from installers.macos import packer
from installers.macos.disk_image import APP_AT, APPLICATIONS_AT, VOLUME, WINDOW, dmg, hfs_image, settings
from tests.installers.macos.made_up_app import ICON, context, made_up_app, put

TOOLS = shutil.which("xorrisofs") is not None and shutil.which("7z") is not None


def test_dmgbuild_settings_place_application_and_applications_link(tmp_path: Path) -> None:
    app = tmp_path / "NEP Studio.app"
    told = settings(app, tmp_path / "background.png", tmp_path / "nep-studio.icns")
    assert told["files"] == [(str(app), "NEP Studio.app")]
    assert told["symlinks"] == {"Applications": "/Applications"}
    assert told["icon_locations"] == {"NEP Studio.app": APP_AT, "Applications": APPLICATIONS_AT}
    assert told["icon_locations"].keys() == {name for _path, name in told["files"]} | told["symlinks"].keys()
    (_left, _top), size = told["window_rect"]
    assert size == WINDOW
    assert APP_AT[0] < size[0] / 2 < APPLICATIONS_AT[0]
    assert told["format"] == "ULMO"


def test_dmgbuild_supports_every_generated_setting(tmp_path: Path) -> None:
    """dmgbuild can be imported only on macOS and ignores unknown options, so its source is searched."""
    found = find_spec("ds_store")
    if found is None or found.origin is None:
        pytest.skip("needs dmgbuild")
    source = (Path(found.origin).parents[1] / "dmgbuild" / "core.py").read_text("utf-8")
    for option in settings(tmp_path, tmp_path, tmp_path):
        assert f'"{option}": ' in source, option


@pytest.mark.skipif(this_system() == "macos", reason="a Mac can make it")
def test_missing_hdiutil_is_reported(tmp_path: Path) -> None:
    with pytest.raises(PackageError, match="on a Mac only"):
        dmg(tmp_path / "a.dmg", tmp_path / "a.app", tmp_path / "b.png", tmp_path / "c.icns")
    with pytest.raises(PackageError, match="on a Mac only"):
        packer.build(context(tmp_path), keep_frozen=False)


@pytest.mark.skipif(not TOOLS, reason="needs xorriso and p7zip")
def test_image_contains_the_application_with_its_symlinks_and_the_finder_layout(tmp_path: Path) -> None:
    store = pytest.importorskip("ds_store").DSStore
    app = made_up_app(tmp_path)
    icon, ground = put(tmp_path / "nep-studio.icns", ICON), put(tmp_path / "background.png", b"picture")
    image = hfs_image(context(tmp_path), tmp_path / "a.img", app, ground, icon)
    out = tmp_path / "out"
    done = subprocess.run(
        ["7z", "x", "-snl", "-snld", "-thfs", f"-o{out}", image], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    volume = next(path for path in (out / VOLUME, out) if (path / app.name).is_dir())
    for path in sorted(app.rglob("*")):
        copy = volume / path.relative_to(tmp_path)
        if path.is_symlink():
            assert copy.readlink() == path.readlink(), path
        elif path.is_file():
            assert copy.read_bytes() == path.read_bytes(), path
    # 7z rewrites absolute links to paths below the output folder
    assert (volume / "Applications").readlink() == out / "Applications"
    assert (volume / ".background.png").read_bytes() == b"picture"
    with store.open(str(volume / ".DS_Store"), "r") as finder:
        assert finder[app.name]["Iloc"] == APP_AT
        assert finder["Applications"]["Iloc"] == APPLICATIONS_AT
        assert finder["."]["bwsp"]["WindowBounds"] == "{{200, 120}, {640, 400}}"
        assert finder["."]["icvp"]["iconSize"] == 128
