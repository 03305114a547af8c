"""Tests of ``nep-studio --selftest DIR``, which checks every package, with and without the block editor."""

from __future__ import annotations

import json
from pathlib import Path

import cv2
import numpy as np
import psutil
import pytest

from tests.e2e.programs import Program
from tests.e2e.waiting import until
from tests.e2e.x11 import Screen

pytestmark = pytest.mark.timeout(400)
ALWAYS = ("program", "window", "master", "robot", "behaviour", "run", "moves", "stop", "picture", "close")
NO_ROBOT = """
import sys
from app.core.robots import launcher
from app.__main__ import main
from app.robots.virtual_models import VirtualModel
launcher.virtual_models = lambda: {"pepper": VirtualModel("pepper", "Pepper", "app.robots.nobody")}
sys.exit(main(sys.argv[1:]))
"""
NO_WEB = """
import sys
for name in ("WebChannel", "WebEngineCore", "WebEngineWidgets"):
    sys.modules[f"PySide6.Qt{name}"] = None  # as where they can't be loaded
from app.__main__ import main
sys.exit(main(sys.argv[1:]))
"""


class Tried:
    """Self-test in a process of its own."""

    def __init__(
        self, screen: Screen, folder: Path, *arguments: str, begin: tuple[str, ...] = ("-m", "app")
    ) -> None:
        self.folder, self.own = folder, folder.parent / "a person's own"
        self.program = Program(
            *begin,
            "--selftest",
            str(folder),
            *arguments,
            environment={
                "DISPLAY": screen.display,
                "QT_QPA_PLATFORM": "xcb",
                "QT_QUICK_BACKEND": "software",
                "NEP_STUDIO_HOME": str(self.own),
                "NEP_STATE_DIR": str(self.own),
            },
        )

    @property
    def report(self) -> dict:
        """Content of the report file."""
        return json.loads((self.folder / "report.json").read_text("utf-8"))

    def steps(self) -> dict[str, dict]:
        """Steps of the report by name."""
        return {step["name"]: step for step in self.report["steps"]}

    def left(self) -> list[psutil.Process]:
        """Return the processes that still run in the home folder of the self-test."""
        found = []
        for process in psutil.process_iter():
            try:
                home = process.environ().get("NEP_STUDIO_HOME", "")
            except psutil.Error:
                continue
            if home.startswith(str(self.folder)) and process.status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        return found

    def nothing_is_left(self) -> None:
        """Wait until all processes have ended; those of the web engine end a moment after their parent."""
        until(lambda: not self.left(), lambda: f"all have ended: {self.left()}")


def went_well(tried: Tried, *names: str) -> None:
    assert tried.program.process.returncode == 0, (tried.report["why"], tried.program.lines[-5:])
    report, steps = tried.report, tried.steps()
    assert (report["ok"], report["why"]) == (True, "")
    assert tuple(steps) == names
    assert all(step["ok"] for step in steps.values())
    assert 0 < report["first_paint_ms"] <= steps["robot"]["ms"] <= report["total_ms"]
    assert "Pepper stopped (" in steps["stop"]["said"]
    tried.nothing_is_left()
    assert {path.name for path in tried.folder.iterdir()} == {"report.json", "window.png"}
    assert not tried.own.exists()  # the user's own settings are untouched


def picture(tried: Tried) -> np.ndarray:
    data = np.frombuffer((tried.folder / "window.png").read_bytes(), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "自己 テスト"
    folder.mkdir()
    return folder


def test_self_test_with_editor_passes_every_step_and_leaves_no_process(screen: Screen, folder: Path) -> None:
    tried = Tried(screen, folder / "with")
    with tried.program as program:
        program.wait(360)
    went_well(tried, *ALWAYS[:5], "editor", *ALWAYS[5:], "processes")
    assert tried.report["first_paint_ms"] < tried.report["editor_ready_ms"] < tried.report["total_ms"]
    blue = (picture(tried) == (182, 76, 41)).all(axis=2)  # the colour of blocks of robot actions
    assert blue[200:700, 230:600].mean() > 0.1


def test_self_test_without_editor_passes_while_another_self_test_runs(screen: Screen, folder: Path) -> None:
    other = Tried(screen, folder / "with")
    tried = Tried(screen, folder / "without", "--no-web", begin=("-c", NO_WEB))
    with other.program, tried.program:
        other.program.wait(360)
        tried.program.wait(360)
    went_well(other, *ALWAYS[:5], "editor", *ALWAYS[5:], "processes")
    went_well(tried, *ALWAYS, "processes")
    assert tried.report["editor_ready_ms"] is None
    assert not tried.report["web"]
    assert not [line for line in tried.program.lines if "Traceback" in line or "uncaught exception" in line]
    assert picture(tried).shape == (900, 1440, 3)


def test_failed_step_is_reported_before_its_time_limit_with_its_reason(
    screen: Screen, tmp_path: Path
) -> None:
    tried = Tried(screen, tmp_path / "out", "--no-web", begin=("-c", NO_ROBOT))
    with tried.program as program:
        assert program.wait(360) == 1, program.lines
        assert any("The virtual robot Pepper stopped unexpectedly." in line for line in program.lines)
    report, robot = tried.report, tried.steps()["robot"]
    assert not report["ok"]
    assert report["why"] == robot["said"]
    assert "the virtual robot: The virtual robot Pepper stopped unexpectedly." in report["why"]
    assert "app.robots.nobody" in report["why"]
    assert not robot["ok"]
    assert robot["ms"] - robot["began_ms"] < robot["bound_s"] * 1000  # failed before the time limit
    assert picture(tried).shape == (900, 1440, 3)
    tried.nothing_is_left()
