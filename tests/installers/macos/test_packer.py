"""What is made before freezing, and how the application is completed."""

from __future__ import annotations

import plistlib
import sys
from pathlib import Path

import pytest

from installers.context import ROOT, Context, PackageError
from installers.macos import packer, signing
from installers.macos.information import information
from tests.installers.macos.made_up_app import VERSION, context


class Elsewhere(Context):
    """Its results go into a folder of the test, not into the checkout."""

    place: Path

    @property
    def work(self) -> Path:
        return self.place


def test_what_pyinstaller_needs_is_made_before(tmp_path: Path) -> None:
    made = Elsewhere("macos", python=(sys.executable,), root=ROOT, version=VERSION, machine="arm64", epoch=1)
    object.__setattr__(made, "place", tmp_path)
    told = packer.prepare(made)
    assert told.keys() == {"NEP_PACKAGE_ICON", "NEP_PACKAGE_INFO_PLIST"}
    icon, plist = Path(told["NEP_PACKAGE_ICON"]), Path(told["NEP_PACKAGE_INFO_PLIST"])
    content = plistlib.loads(plist.read_bytes())
    assert content == information(VERSION, "arm64")
    assert icon.name == content["CFBundleIconFile"]  # PyInstaller keeps its name
    assert icon.read_bytes()[:4] == b"icns"
    for word in told:
        assert word in (ROOT / "installers" / "nep-studio.spec").read_text("utf-8")


def test_what_was_not_frozen_can_not_be_packed(tmp_path: Path) -> None:
    made = context(tmp_path)
    with pytest.raises(PackageError, match=r"NEP Studio\.app"):
        packer.finish(made, packer.application(made), signing.identity_of({}))
