"""Real Studio in a process of its own, with the processes of its network."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path

import cv2
import psutil

from tests.e2e.person import STEP_S, Person
from tests.e2e.x11 import Screen

ROOT = Path(__file__).resolve().parents[2]
PROBE = Path(__file__).parent / "window_probe"
START_S, END_S = 120.0, 60.0


class Studio(Person):
    """Process of ``python -m app`` with all its files in one folder."""

    def __init__(self, screen: Screen, home: Path, master: str, *arguments: str, **environment: str) -> None:
        super().__init__(screen, self._request)
        home.mkdir(parents=True, exist_ok=True)
        self.home, self.master = home, master
        self._news = threading.Condition()
        self._answers: dict[int, object] = {}
        self._asked = 0
        self._ended = False
        self._log = (home / "studio.log").open("ab")
        self.process = self._start(arguments, environment)
        self._reader = threading.Thread(target=self._read, name="probe-reader", daemon=True)
        self._reader.start()

    def _start(self, arguments: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
        requests, self._requests = os.pipe()
        self._heard, answers = os.pipe()
        environ = {
            **os.environ,
            "DISPLAY": self.screen.display,
            "QT_QPA_PLATFORM": "xcb",
            "QT_QUICK_BACKEND": "software",
            "QT_SCALE_FACTOR": "1",
            "NEP_MASTER": self.master,
            "NEP_STUDIO_HOME": str(self.home),
            "NEP_STATE_DIR": str(self.home / "state"),
            "NEP_GATEWAY": "0",
            "NEP_E2E_PROBE": f"{requests},{answers}",
            "PYTHONPATH": f"{PROBE}{os.pathsep}{ROOT}",
            "PYTHONUNBUFFERED": "1",
            **environment,
        }
        if os.geteuid() == 0:
            environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"
        command = [sys.executable, "-m", "app", "--theme", "light", *arguments]
        process = subprocess.Popen(
            command,
            cwd=ROOT,
            env=environ,
            stdin=subprocess.DEVNULL,
            stdout=self._log,
            stderr=self._log,
            pass_fds=(requests, answers),
        )
        os.close(requests)
        os.close(answers)
        return process

    # -- the probe --------------------------------------------------------------------------------

    def _read(self) -> None:
        with os.fdopen(self._heard, "rb") as stream:
            for line in stream:
                answer = json.loads(line)
                with self._news:
                    self._answers[answer["to"]] = answer["is"]
                    self._news.notify_all()
        with self._news:
            self._ended = True
            self._news.notify_all()

    def _request(self, what: str, **more: object) -> object:
        with self._news:
            self._asked += 1
            number = self._asked
            data = json.dumps({"n": number, "do": what, **more}).encode() + b"\n"
            os.write(self._requests, data)
            came = self._news.wait_for(lambda: number in self._answers or self._ended, STEP_S)
            assert came, f"Studio does not look up within {STEP_S:g} s\n{self.log}"
            assert number in self._answers, f"Studio has ended\n{self.log}"
            return self._answers.pop(number)

    @property
    def log(self) -> str:
        """Last 3000 characters of its output."""
        return (self.home / "studio.log").read_text("utf-8", "replace")[-3000:]

    def use_virtual_pepper(self, block: str = "started") -> None:
        """Choose the virtual Pepper once a block is shown, and wait until it is ready.

        Loading the blocks closes an open menu, whose entry would be missed.
        """
        self.spot(f"[data-id={block}]")
        self.choose("Robots", "Use the virtual Pepper")
        self.says("Pepper ready")

    # -- processes of Studio ----------------------------------------------------------------------

    def wait_up(self) -> Studio:
        """Wait until the window is visible and painted."""
        self.find(kind="MainWindow", within_s=START_S)
        return self

    def children(self, *words: str) -> list[psutil.Process]:
        """Return the processes in this Studio's network whose command line contains these words."""
        found = []
        for process in psutil.process_iter(["cmdline", "status"]):
            line = " ".join(process.info["cmdline"] or [])
            if all(word in line for word in words) and process.info["status"] != psutil.STATUS_ZOMBIE:
                try:
                    ours = process.environ().get("NEP_MASTER") == self.master
                except psutil.Error:
                    continue
                if ours:
                    found.append(process)
        return found

    def programs(self) -> list[psutil.Process]:
        """Return the processes of running behaviours: the spare process has no connections."""
        found = []
        for process in self.children("app.blocks.runtime.child"):
            with contextlib.suppress(psutil.NoSuchProcess):
                if process.net_connections():
                    found.append(process)
        return found

    def kill(self) -> None:
        """Kill the process with SIGKILL, without any cleanup by Studio."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(END_S)

    def quit(self) -> int:
        """Quit by the menu and return the exit code."""
        self.choose("File", "Quit")
        return self.process.wait(END_S)

    def close(self) -> None:
        """End the process in any state and close its files."""
        if self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(END_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait(END_S)
        os.close(self._requests)
        self._reader.join(END_S)
        self._log.close()


def save_picture(screen: Screen, path: Path) -> None:
    """Save the whole screen as a picture, to investigate a failed test."""
    picture = screen.picture((0, 0, 1600, 1000))
    cv2.imwrite(str(path), picture[:, :, ::-1])


def terminate_all(processes: Sequence[psutil.Process]) -> None:
    """Kill processes that a test left running."""
    for process in processes:
        try:
            process.kill()
            process.wait(END_S)
        except psutil.Error:
            continue
