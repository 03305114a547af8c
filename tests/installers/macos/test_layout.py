"""Tests of the layout check of an application bundle: PyInstaller's output passes, errors are detected."""

from __future__ import annotations

import plistlib
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from installers.macos.information import information
from installers.macos.layout import binaries_for_newer_macos, check
from tests.installers.macos.made_up_app import (
    LIBRARY,
    PROGRAM,
    VERSION,
    fat,
    framework,
    header,
    link,
    made_up_app,
    put,
)

QT = Path("Contents/Frameworks/PySide6/Qt/lib")
WEB = QT / "QtWebEngineCore.framework/Versions/A"
PROCESS = WEB / "Helpers/QtWebEngineProcess.app/Contents/MacOS/QtWebEngineProcess"


def spoil_information(app: Path) -> None:
    told = information(VERSION, "arm64")
    told["LSBackgroundOnly"] = True
    put(app / "Contents/Info.plist", plistlib.dumps(told))


def link_to_the_builder(app: Path) -> None:
    link(app / "Contents/Resources/python", "/usr/bin/python3")


def link_out(app: Path) -> None:
    link(app / "Contents/Resources/notes", "../../../notes")


def library_without_program(app: Path) -> None:
    """Add a framework without its library, as is left when only the library is excluded."""
    root = framework(app / QT, "QtXml")
    (root / "Versions/A/QtXml").unlink()
    (root / "QtXml").unlink()


def file_beside_versions(app: Path) -> None:
    put(app / QT / "QtCore.framework/QtCore.prl")


SPOILED: dict[str, tuple[Callable[[Path], object], str]] = {
    "hidden from the Dock": (
        spoil_information,
        "Contents/Info.plist has True for LSBackgroundOnly, not False",
    ),
    "no Info.plist": (
        lambda app: (app / "Contents/Info.plist").unlink(),
        "Contents/Info.plist can't be read",
    ),
    "no program": (lambda app: (app / "Contents/MacOS/nep-studio").unlink(), "has no program 'nep-studio'"),
    "a library in its place": (
        lambda app: put(app / "Contents/MacOS/nep-studio", header(LIBRARY)),
        "has no program 'nep-studio'",
    ),
    "not executable": (lambda app: (app / "Contents/MacOS/nep-studio").chmod(0o644), "is not executable"),
    "no icon": (
        lambda app: (app / "Contents/Resources/nep-studio.icns").unlink(),
        "no icon 'nep-studio.icns'",
    ),
    "half an icon": (
        lambda app: put(app / "Contents/Resources/behaviour.icns", b"icns\0\0\1\0"),
        "no icon 'behaviour.icns'",
    ),
    "no Spanish": (lambda app: shutil.rmtree(app / "Contents/Resources/es.lproj"), "no texts for 'es'"),
    "next to Contents": (lambda app: put(app / "readme.txt"), "readme.txt is next to Contents"),
    "next to MacOS": (lambda app: put(app / "Contents/readme.txt"), "readme.txt is not allowed in Contents"),
    "an absolute link": (link_to_the_builder, "is a link to the absolute path '/usr/bin/python3'"),
    "a link out": (link_out, "is a link out of the application"),
    "a broken link": (
        lambda app: link(app / "Contents/Resources/x", "y"),
        "Contents/Resources/x is a broken link",
    ),
    "code among resources": (
        lambda app: put(app / "Contents/Resources/cv2/cv2.so", header()),
        "cv2.so is code in Resources",
    ),
    "data among code": (lambda app: put(app / "Contents/Frameworks/cv2/config.py"), "config.py is not code"),
    "a dot in a folder": (
        lambda app: put(app / "Contents/Frameworks/numpy.libs/a.dylib", header()),
        "numpy.libs has a dot in its name",
    ),
    "an emptied framework": (library_without_program, "QtXml.framework has no library 'QtXml'"),
    "a file next to Versions": (file_beside_versions, "QtCore.prl is next to Versions"),
    "no version of a framework": (
        lambda app: (app / QT / "QtCore.framework/Versions/Current").unlink(),
        "QtCore.framework has no link Versions/Current",
    ),
    "no Info.plist of a framework": (
        lambda app: (app / QT / "QtCore.framework/Versions/A/Resources/Info.plist").unlink(),
        "QtCore.framework has no Resources/Info.plist",
    ),
    "no web engine": (
        lambda app: shutil.rmtree(app / WEB.parents[1]),
        "there are 0 QtWebEngineCore.framework",
    ),
    "no web process": (lambda app: (app / PROCESS).unlink(), "has no Helpers/QtWebEngineProcess.app"),
    "web process not executable": (
        lambda app: (app / PROCESS).chmod(0o644),
        "QtWebEngineProcess is not executable",
    ),
    "no texts of Chromium": (
        lambda app: (app / WEB / "Resources/icudtl.dat").unlink(),
        "no Resources/icudtl.dat",
    ),
    "a library that was left out": (
        lambda app: put(app / "Contents/Frameworks/a.so", header(needs=["@rpath/libzmq.5.dylib"])),
        "a.so is linked with '@rpath/libzmq.5.dylib', which is missing",
    ),
    "a library of the builder": (
        lambda app: put(app / "Contents/Frameworks/a.so", header(needs=["/opt/homebrew/lib/libpng.dylib"])),
        "a.so is linked with '/opt/homebrew/lib/libpng.dylib', which is missing",
    ),
    "another processor": (
        lambda app: put(app / "Contents/Frameworks/libpython3.13.dylib", header(machine="x86_64")),
        "libpython3.13.dylib is built for x86_64, not arm64",
    ),
}


def test_pyinstaller_output_passes_the_layout_check(tmp_path: Path) -> None:
    assert check(made_up_app(tmp_path), VERSION, "arm64") == []


@pytest.mark.parametrize("case", SPOILED)
def test_each_layout_error_is_detected(tmp_path: Path, case: str) -> None:
    app = made_up_app(tmp_path)
    spoil, said = SPOILED[case]
    spoil(app)
    found = check(app, VERSION, "arm64")
    assert any(said in sentence for sentence in found), found


def test_version_mismatch_is_detected(tmp_path: Path) -> None:
    found = check(made_up_app(tmp_path), "0.2.0", "arm64")
    assert found[0] == "Contents/Info.plist has '0.1.0' for CFBundleVersion, not '0.2.0'"


def test_libraries_that_need_a_newer_macos_are_reported(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    assert binaries_for_newer_macos(app, "arm64") == {}
    newer = put(app / "Contents/Frameworks/a.so", fat(header(macos=(15, 2)), header(machine="x86_64")))
    assert binaries_for_newer_macos(app, "arm64") == {newer: "15.2"}
    assert check(app, VERSION, "arm64") == []  # only a report: macOS loads the library anyway


def test_executable_with_a_library_slice_passes_the_layout_check(tmp_path: Path) -> None:
    app = made_up_app(tmp_path)
    put(app / "Contents/MacOS/nep-studio", fat(header(LIBRARY), header(PROGRAM)), 0o755)
    assert check(app, VERSION, "arm64") == []
