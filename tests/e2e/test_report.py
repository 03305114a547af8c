"""Tests of real crashes of Studio: the next start offers to report them once."""

from __future__ import annotations

import signal
import zipfile
from collections.abc import Callable
from pathlib import Path

import psutil
import pytest

from app.ui.startup.single_instance import socket_name
from tests.e2e.behaviours import say, started, write
from tests.e2e.studio import END_S, Studio
from tests.e2e.waiting import until

pytestmark = pytest.mark.timeout(400)
OFFER = "Studio closed unexpectedly last time."


def kept(studio: Studio) -> list[str]:
    return sorted(path.name for path in (studio.home / "log" / "crashes").glob("*.txt"))


def crash(studio: Studio, number: int) -> None:
    assert list((studio.home / "runs").glob("*.json")), "a run leaves a mark"
    studio.process.send_signal(number)
    assert studio.process.wait(END_S) == -number


def renderers_of(studio: Studio) -> list[psutil.Process]:
    """Return the renderer processes, which Chromium forks from zygotes that are children of Studio."""
    own = psutil.Process(studio.process.pid).children()
    return [each for zygote in own if "--type=zygote" in zygote.cmdline() for each in zygote.children()]


def has_looked_back(studio: Studio) -> None:
    """Wait until the start has checked for earlier crashes, which happens before its socket exists."""
    until(lambda: Path(socket_name(studio.home)).exists(), "it can be found")
    studio.choose("Help", "About NEP Studio")
    studio.says("Copy version information")
    studio.screen.key("Escape")


def test_native_crash_is_offered_once_and_its_report_is_written(
    start: Callable[..., Studio], tmp_path: Path
) -> None:
    documents = tmp_path / "Documents"
    documents.mkdir()
    path = write(tmp_path / "Mine.nepb", started(say("a secret of mine")))
    crash(start(str(path)), signal.SIGSEGV)
    again = start()
    again.says(OFFER)
    again.click("Report a problem", kind="Button")
    again.says("1 crash report")
    again.find("What happened?", focus=True)
    again.screen.type("it went away")
    again.click("Write report")
    again.find("File name", focus=True)
    again.screen.key("a", ["Ctrl"])
    again.screen.type(str(documents / "report.zip"))
    again.screen.key("Return")
    again.says("Report saved to")
    with zipfile.ZipFile(documents / "report.zip") as archive:
        found = {name: archive.read(name).decode("utf-8", "replace") for name in archive.namelist()}
    assert found["what-happened.txt"] == "it went away"
    told = next(text for name, text in found.items() if name.startswith("crashes/"))
    assert "how: Fatal Python error: Segmentation fault" in told
    assert "application.py" in told, "where it was"
    assert "a secret of mine" not in "".join(found.values())
    assert found["doctor.txt"].strip()
    again.screen.key("Escape")
    assert again.quit() == 0
    assert not list((again.home / "runs").iterdir()), "a run that ends in order leaves nothing"
    third = start()
    has_looked_back(third)
    assert not third.all(OFFER)
    assert third.quit() == 0


@pytest.mark.long
def test_kill_by_the_system_is_reported_once_and_requested_exit_is_not(
    start: Callable[..., Studio],
) -> None:
    first = start()
    first.kill()
    again = start()
    again.says(OFFER)
    report = next((again.home / "log" / "crashes").glob("*.txt")).read_text("utf-8")
    assert "without leaving a trace" in report
    again.click("Dismiss")
    again.process.send_signal(signal.SIGTERM)
    assert again.process.wait(END_S) == 0
    third = start()
    has_looked_back(third)
    assert not third.all(OFFER)
    assert len(kept(third)) == 1
    assert third.quit() == 0


@pytest.mark.long
def test_robot_and_editor_crashes_are_saved_and_next_start_reports_the_robot_crash(
    start: Callable[..., Studio],
) -> None:
    studio = start("--demo")
    studio.says("Pepper is connected")
    (robot,) = studio.children("app.robots.simulated")
    robot.send_signal(signal.SIGSEGV)
    studio.says("The virtual robot Pepper stopped unexpectedly.")
    until(lambda: [name for name in kept(studio) if "robot" in name], "it is reported")
    renderers = until(lambda: renderers_of(studio), "the editor's page has its process")
    renderers[0].send_signal(signal.SIGSEGV)
    until(lambda: [name for name in kept(studio) if "editor" in name], "it is reported")
    assert not studio.all("A virtual robot crashed last time."), "it was told when it happened"
    told = next((studio.home / "log" / "crashes").glob("*robot*.txt")).read_text("utf-8")
    assert "ended by signal 11 (SIGSEGV)" in told
    assert "Fatal Python error: Segmentation fault" in told
    assert studio.quit() == 0
    again = start()
    again.says("A virtual robot crashed last time.")
    assert again.quit() == 0
