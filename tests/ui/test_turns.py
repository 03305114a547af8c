"""A thread that is busy in Python lets the window have its turn soon."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator

import pytest

from app.ui.startup import interpreter


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)


def test_the_window_never_waits_for_as_long_as_python_would_let_it() -> None:
    sys.setswitchinterval(0.005)
    interpreter.shorten()
    assert sys.getswitchinterval() <= 0.001


def test_studio_does_so_when_it_starts() -> None:
    program = (
        "import sys\n"
        "from app.ui.application import make_application\n"
        "make_application()\n"
        "print(sys.getswitchinterval())\n"
    )
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    said = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True
    )
    assert float(said.stdout) == pytest.approx(interpreter.TURN_S)
