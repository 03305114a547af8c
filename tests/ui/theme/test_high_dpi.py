"""Test of the window at scale factors 1.25 and 1.5, each in its own process as Qt reads the factor once."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

LOOK = """
import sys
import pytest
from PySide6.QtWidgets import QApplication

application = QApplication(["nep-studio"])
assert application.devicePixelRatio() == float(sys.argv[1]), application.devicePixelRatio()
sys.exit(pytest.main(["-q", "--long", "tests/ui/theme/test_text_sizes.py::test_window_clips_no_text"]))
"""


@pytest.mark.timeout(400)
@pytest.mark.parametrize("scale", ["1.25", "1.5"])
def test_window_clips_no_text_at_fractional_scales(scale: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", LOOK, scale],
        cwd=Path(__file__).parents[3],
        env={**os.environ, "QT_QPA_PLATFORM": "offscreen", "QT_SCALE_FACTOR": scale},
        capture_output=True,
        text=True,
        timeout=380,
        check=False,
    )
    assert done.returncode == 0, f"{done.stdout[-3000:]}\n{done.stderr[-1000:]}"
    assert "7 passed" in done.stdout
