"""Tests of the macOS packer as a whole, with fake tools: the inputs of freezing and the steps after it."""

from __future__ import annotations

import dataclasses
import json
import plistlib
import sys
from pathlib import Path

import pytest

from installers.context import ROOT, PackageError
from installers.macos import packer, signing
from installers.macos.information import information
from tests.installers.macos.made_up_app import ICON, VERSION, calls, context, noting_tools, put

NAME = "Developer ID Application: Ana Pérez (ABCDE12345)"
MADE = ("NEP_PACKAGE_ICON", "NEP_PACKAGE_INFO_PLIST")

PYTHON = """#!{python}
import json, os, shutil, sys
from pathlib import Path
sys.path.insert(0, {root!r})
from tests.installers.macos.made_up_app import ICON, made_up_app, put
words = sys.argv[1:]
with open({log!r}, "a", encoding="utf-8") as file:
    file.write(json.dumps(["python", *words[:2]]) + "\\n")
if words[1] == "installers.macos.pictures":
    for name in ("nep-studio.icns", "behaviour.icns", "background.png"):
        put(Path(words[2]) / name, ICON)
elif words[1] == "PyInstaller":
    assert all(Path(os.environ[name]).is_file() for name in {made!r})
    folder = Path(words[words.index("--distpath") + 1])
    (folder / "NEP Studio").mkdir(parents=True)
    app = made_up_app(folder)
    for language in ("en", "es", "fr", "ja"):
        shutil.rmtree(app / "Contents" / "Resources" / f"{{language}}.lproj")
    (app / "Contents" / "Resources" / "behaviour.icns").unlink()
else:
    put(Path(words[4]) / "NOTICE.txt")
    put(Path(words[5]))
"""

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="its tools are scripts of a Unix")


def test_inputs_of_pyinstaller_are_generated_before_freezing(tmp_path: Path) -> None:
    made = dataclasses.replace(context(tmp_path), python=(sys.executable,))
    (tmp_path / "installers").symlink_to(ROOT / "installers")
    for name in ("app", "nep", "resources"):
        (tmp_path / name).symlink_to(ROOT / name)
    told = packer.prepare(made)
    assert tuple(told) == MADE
    icon, plist = (Path(told[name]) for name in MADE)
    content = plistlib.loads(plist.read_bytes())
    assert content == information(VERSION, "arm64")
    assert icon.name == content["CFBundleIconFile"]  # PyInstaller keeps the name of the icon file
    assert icon.read_bytes()[:4] == b"icns"
    for word in told:
        assert word in (ROOT / "installers" / "nep-studio.spec").read_text("utf-8")


def test_application_is_frozen_then_signed_then_put_into_the_image(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = noting_tools(tmp_path / "tools", sys.executable)
    monkeypatch.setenv("PATH", str(log.parent))
    for name in MADE:
        monkeypatch.setenv(name, "")
    text = PYTHON.format(python=sys.executable, root=str(ROOT), log=str(log), made=MADE)
    python = put(tmp_path / "python", text.encode(), 0o755)
    made = dataclasses.replace(context(tmp_path), python=(str(python),))

    def image(target: Path, app: Path, background: Path, icon: Path) -> Path:
        with log.open("a", encoding="utf-8") as file:
            file.write(json.dumps(["image", app.name, background.name, icon.name]) + "\n")
        return put(target)

    identity = signing.Identity(NAME, ("--keychain-profile", "school"))
    packages = packer.pack(made, identity, image, keep_frozen=False)
    assert [path.name for path in packages] == [
        "NEP-Studio-0.1.0-macos-arm64.dmg",
        "NEP-Studio-0.1.0-macos-arm64.cdx.json",
    ]
    steps = [
        " ".join([call[0], *(word for word in call[1:3] if not word.startswith("/"))]) for call in calls(log)
    ]
    in_turn = list(dict.fromkeys(steps))
    assert in_turn == [
        "python -m installers.macos.pictures",
        "python -m PyInstaller",
        "python macos",
        "codesign --force --sign",
        "codesign --verify --deep",
        "ditto -c -k",
        "xcrun notarytool submit",
        "xcrun stapler staple",
        "xcrun stapler validate",
        "spctl --assess --type",
        "image NEP Studio.app background.png",
    ]
    assert steps[-5:] == [
        "codesign --force --sign",
        "xcrun notarytool submit",
        "xcrun stapler staple",
        "xcrun stapler validate",
        "spctl --assess --type",
    ]  # on the disk image
    resources = packer.application(made) / "Contents" / "Resources"
    assert (resources / "NOTICE.txt").is_file()
    assert (resources / "behaviour.icns").read_bytes() == ICON
    log.write_text("")
    packer.pack(made, signing.Identity(signing.AD_HOC), image, keep_frozen=True)
    assert ["python", "-m", "PyInstaller"] not in calls(log)


def test_packing_without_a_frozen_application_raises(tmp_path: Path) -> None:
    made = context(tmp_path)
    with pytest.raises(PackageError, match=r"NEP Studio\.app"):
        packer.finish(made, packer.application(made), signing.identity_of({}))
