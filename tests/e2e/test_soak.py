"""Soak test of one minute under full load: memory, handles and threads stay constant."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.e2e.x11 import Screen

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_memory_handles_and_threads_stay_constant_for_a_minute_under_load(
    screen: Screen, tmp_path: Path
) -> None:
    samples = tmp_path / "soak.csv"
    done = subprocess.run(
        [sys.executable, str(ROOT / "bench" / "soak.py"), "--minutes", "1", "--csv", str(samples)],
        cwd=ROOT,
        env={
            **os.environ,
            "DISPLAY": screen.display,
            "QT_QPA_PLATFORM": "xcb",
            "QT_QUICK_BACKEND": "software",
            "PYTHONPATH": str(ROOT),
        },
        capture_output=True,
        text=True,
        timeout=380,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr[-3000:]
    assert len(samples.read_text().splitlines()) > 5
