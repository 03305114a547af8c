"""Tests of the UI test configuration: a Qt warning fails the test that caused it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

INNER = """
from PySide6.QtCore import qWarning
from PySide6.QtWidgets import QLabel

kept = []

class WarnsWhenClosed(QLabel):
    def closeEvent(self, event):
        qWarning("closing hurts")

def test_quiet(qtbot):
    label = QLabel("x")
    qtbot.addWidget(label)
    label.show()

def test_warns(qtbot):
    qWarning("running hurts")

def test_known_noise(qtbot):
    qWarning("This plugin does not support propagateSizeHints()")

def test_warns_when_closed(qtbot):
    kept.append(WarnsWhenClosed("x"))
    qtbot.addWidget(kept[0])
    kept[0].show()
"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Output of pytest for the inner tests, run with this project's `conftest.py` and configuration."""
    folder = tmp_path_factory.mktemp("inner")
    (folder / "test_inner.py").write_text(INNER, encoding="utf-8")
    (folder / "conftest.py").write_bytes((ROOT / "tests" / "ui" / "conftest.py").read_bytes())
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder)]
    done = subprocess.run(
        [*command, str(folder / "test_inner.py")],
        cwd=folder,
        env=os.environ | {"QT_QPA_PLATFORM": "offscreen"},
        capture_output=True,
        text=True,
        timeout=140,
        check=False,
    )
    return done.stdout


def test_qt_warning_fails_the_test_that_caused_it(report: str) -> None:
    assert "FAILED test_inner.py::test_warns -" in report or "FAILED test_inner.py::test_warns\n" in report


def test_qt_warning_at_teardown_fails_the_test_that_caused_it(report: str) -> None:
    assert "ERROR test_inner.py::test_warns_when_closed" in report
    assert "closing hurts" in report


def test_expected_qt_warnings_do_not_fail_a_test(report: str) -> None:
    assert "1 failed, 3 passed, 1 error" in report
