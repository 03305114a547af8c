"""Tests of Studio without a network: the loopback alone is sufficient, and a missing one is reported."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.core.network_of_ones_own import alone

FIREWALL = "10.9.9.2 is off, is on another network, or has a firewall that blocks the connection."
LOOK = """
import sys, threading, time
from pathlib import Path
from app.core.session import Session
from app.core.storage.settings import Settings

session = Session(Settings(Path(sys.argv[1])), journal_folder=Path(sys.argv[1]) / "journal")
session.start()
end = time.monotonic() + 60
while not session.alerts.has("companion:master") and time.monotonic() < end:
    session.tick()
    threading.Event().wait(0.03)
for alert in session.alerts.active:
    print(alert.id, alert.title, alert.detail, alert.intent)
for _ in range(100):
    session.tick()
    threading.Event().wait(0.03)
print(len(session.console.records), "line")
session.close()
"""


def test_loopback_down_is_reported_once_with_advice(tmp_path: Path) -> None:
    done = alone("-c", LOOK, str(tmp_path), up=False, timeout_s=120)
    assert "Traceback" not in done.stderr
    alert, lines = done.stdout.splitlines()
    assert alert == (
        "companion:master The master can't be started. Programs on this computer can't reach each other: "
        "network is unreachable. Turn on the loopback interface. A firewall or a sandbox may have turned "
        "it off. OpenDoctor()"
    )
    assert lines == "1 line"


def test_doctor_reports_firewall_that_drops_packets() -> None:
    done = alone(
        "-m", "nep", "doctor", up=True, timeout_s=120, silent="10.9.9.1/24", NEP_MASTER="10.9.9.2:7780"
    )  # fmt: skip
    assert "10.9.9.2:7780 doesn't respond, so the master can't be reached." in done.stdout, done.stderr
    assert FIREWALL in " ".join(done.stdout.split())
    assert "Traceback" not in done.stderr


def test_firewall_between_studio_and_master_is_reported(tmp_path: Path) -> None:
    done = alone(
        "-c", LOOK, str(tmp_path), up=True, timeout_s=120, silent="10.9.9.1/24", NEP_MASTER="10.9.9.2:7780"
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    alert, lines = done.stdout.splitlines()
    said = "10.9.9.2:7780 doesn't respond, so the master can't be reached."
    assert alert.startswith(f"companion:master The master doesn't respond. {said} {FIREWALL}")
    assert alert.endswith("OpenDoctor()")
    assert lines == "1 line"


WORK = """
import sys
from pathlib import Path
from app.core.session import Session
from app.core.storage.settings import Settings
from tests.core.waiting import tick_until

session = Session(Settings(Path(sys.argv[1])), journal_folder=Path(sys.argv[1]) / "journal")
session.start()
tick_until(session, lambda: session.launcher.has_started_master)
session.launcher.start_virtual_robot("Pepper")
tick_until(session, lambda: session.fleet.connected)
link = session.fleet.link("Pepper")
tick_until(session, lambda: link.chip_text == "virtual, ready")
with session.fleet.watch_sensors("Pepper"):
    tick_until(session, lambda: "distance" in link.values)
said = session.fleet.invoke("Pepper", "say", {"text": "hi"})
tick_until(session, lambda: not said.is_running)
walk = session.fleet.invoke("Pepper", "walk", {"distance": 2.0})
tick_until(session, lambda: link.state == "busy")
session.runs.stop()
tick_until(session, lambda: session.runs.view().state == "proven")
print(said.state, walk.state, [alert.title for alert in session.alerts.active])
session.close()
"""


def test_session_master_and_robot_work_with_loopback_only(tmp_path: Path) -> None:
    state = {"NEP_STUDIO_HOME": str(tmp_path / "home"), "NEP_STATE_DIR": str(tmp_path / "state")}
    done = alone("-c", WORK, str(tmp_path), up=True, timeout_s=120, **state)
    assert done.stdout == "succeeded canceled []\n", done.stderr
    assert done.returncode == 0
    assert "Traceback" not in done.stderr


@pytest.mark.long  # every run includes the same without the window
@pytest.mark.e2e
@pytest.mark.slow
@pytest.mark.timeout(180)
def test_studio_master_and_robot_work_with_loopback_only(tmp_path: Path) -> None:
    done = alone(
        "-m",
        "app",
        "--self-drive",
        str(tmp_path / "pictures"),
        up=True,
        timeout_s=170,
        QT_QPA_PLATFORM="offscreen",
        QT_QUICK_BACKEND="software",
        QTWEBENGINE_DISABLE_SANDBOX="1",
        NEP_STUDIO_HOME=str(tmp_path / "home"),
        NEP_STATE_DIR=str(tmp_path / "state"),
    )
    assert "all steps succeeded" in done.stdout, done.stderr
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert len(list((tmp_path / "pictures").glob("*.png"))) >= 5
