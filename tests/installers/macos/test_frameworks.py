"""A framework goes into the package as a whole or not at all: codesign refuses what is left of one."""

from __future__ import annotations

import pytest

from installers.contents import is_wanted

PARTS = (
    "Versions/A/{name}",
    "Versions/A/Resources/Info.plist",
    "Versions/Current",
    "{name}",
    "Resources",
    "Resources/Info.plist",
)
"""What PyInstaller collects of one."""


def wanted(name: str) -> set[bool]:
    return {is_wanted(f"PySide6/Qt/lib/{name}.framework/{part.format(name=name)}") for part in PARTS}


@pytest.mark.parametrize("name", ["QtVirtualKeyboard", "QtQuickControls2", "QtCharts", "QtSql", "Qt3DCore"])
def test_unused_framework_is_left_out_completely(name: str) -> None:
    assert wanted(name) == {False}


@pytest.mark.parametrize(
    "name", ["QtCore", "QtWidgets", "QtWebEngineCore", "QtQuick", "QtQml", "QtMultimedia"]
)
def test_used_framework_is_kept_completely(name: str) -> None:
    assert wanted(name) == {True}
