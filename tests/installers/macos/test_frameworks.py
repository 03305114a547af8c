"""Tests that a framework is packaged completely or not at all, because codesign rejects an incomplete one."""

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
"""Paths that PyInstaller collects from a framework."""


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
