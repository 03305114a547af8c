"""Processes of `paper.py`: ping and pong of a row, and the servers that rows need."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import paper_clients
from paper_ends import KINDS, TYPES
from paper_original import END as ORIGINAL_END
from paper_original import KINDS as ORIGINAL_KINDS
from paper_original import ROW as ORIGINAL
from paper_original import why_missing

HERE = Path(__file__).parent
START_S = 60.0
END_S = 15.0
ERRORS = "errors.txt"
"""File with the standard error of the ROS program that was started last."""
ROS_MASTER = "http://127.0.0.1:11311"


class NotRunError(Exception):
    """A row or a scenario can't be measured; the message has the reason."""


@dataclass(frozen=True)
class Places:
    """Environment of all rows: hosts of both ends, and the command prefix that runs pong in its network.

    Two networks on one computer share its memory, unlike two computers, so shared memory is disabled
    there.
    """

    hosts: tuple[str, str]
    elsewhere: tuple[str, ...]
    folder: Path
    ros_master: str = ""
    rosbridge: str = ""
    rosbridge_master: str = ""
    python2: str = ""
    rosnodejs: str = ""
    """Folder of rosnodejs, or an empty string."""
    missing: Mapping[str, str] = field(default_factory=dict)
    """Reasons why rows can't run, by row name."""

    @property
    def environment(self) -> dict[str, str]:
        """Environment variables that are added for both ends."""
        return {"NEP_SHARED_MEMORY": "0"} if self.elsewhere else {}

    def of(self, row: str) -> tuple[str, str]:
        """Return the `place` arguments of ping and pong. Raises `NotRunError`."""
        if row in self.missing:
            raise NotRunError(self.missing[row])
        if row == "zenoh":
            end = f"tcp/{self.hosts[0]}:{free_port(self.hosts[0])}"
            return end, end
        if row == "nep over zenoh":
            return self._nep_zenoh()
        if row == "rosbridge":
            return self.rosbridge_master, self.rosbridge
        return self.ros_master, self.ros_master

    def _nep_zenoh(self) -> tuple[str, str]:
        if not self.elsewhere:
            here = f"local/paper-{os.getpid()}"
            return here, here
        endpoints = {"endpoints": [f"tcp/{self.hosts[0]}:{free_port(self.hosts[0])}"]}
        # By default, zenoh drops fragments after waiting 50 ms; here 1 MB takes 170 ms.
        drop = {"max_wait_before_drop_fragments": 5_000_000}
        link = {"link": {"tx": {"queue": {"congestion_control": {"drop": drop}}}}}
        files = []
        for what in ("listen", "connect"):
            path = self.folder / f"{what}.json5"
            settings = {"mode": "peer", "transport": link, what: endpoints}
            path.write_text(json.dumps(settings), encoding="utf-8")
            files.append(str(path))
        return files[0], files[1]

    def program(self, row: str, role: str) -> tuple[str, ...]:
        """Return the command of an end, with its arguments except host and place."""
        if role == "pong" and row in paper_clients.ROWS:
            return paper_clients.pong(row, self.folder, TYPES)
        if role == "pong" and row == paper_clients.ROSNODEJS:
            return paper_clients.rosnodejs_pong(self.rosnodejs, self.folder, KINDS)
        if row != ORIGINAL:
            return (sys.executable, str(HERE / "paper_ends.py"), role, row)
        path = self.folder / "paper_original_end.py"
        path.write_text(ORIGINAL_END, encoding="utf-8")
        return (self.python2, "-E", str(path), role, row)  # -E ignores PYTHONPATH, which leads to our nep


class Process:
    """Process of one end of a row."""

    def __init__(self, command: Sequence[str], more: Mapping[str, str]) -> None:
        environment = {**os.environ, "PYTHONPATH": str(HERE.parent), **more}
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
        )

    def write(self, what: object) -> None:
        """Send a request as a line of JSON. Raises `NotRunError`."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(what) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise NotRunError(self._last_words()) from None

    def read(self, key: str) -> Any:  # noqa: ANN401 - what was asked for
        """Return the value of `key` in the reply. Raises `NotRunError` with the reason that was reported."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        answer = json.loads(line) if line else {}
        if key not in answer:
            raise NotRunError(answer.get("not run", self._last_words()))
        return answer[key]

    def _last_words(self) -> str:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            said = json.loads(line)
            if "not run" in said:
                return str(said["not run"])
        return f"one of its programs ended by itself with exit code {self._process.wait()}"

    def close(self) -> None:
        """Close the process's standard input and wait until it ends; kill it after 15 s."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        end(self._process)
        self._process.stdout.close()


class Pair:
    """Running ping and pong of a row. Raises `NotRunError`."""

    def __init__(self, row: str, places: Places) -> None:
        own, others = places.of(row)
        self.kinds = ORIGINAL_KINDS if row == ORIGINAL else KINDS
        commands = (
            (*places.program(row, "ping"), places.hosts[0], own),
            (*places.elsewhere, *places.program(row, "pong"), places.hosts[1], others),
        )
        with ExitStack() as stack:
            self._ends = [Process(command, places.environment) for command in commands]
            for each in self._ends:
                stack.callback(each.close)
            ends = [each.read("end") for each in self._ends]
            for each, other in zip(self._ends, reversed(ends), strict=True):
                each.write(other)
            for each in self._ends:
                each.read("ready")
            self.close = stack.pop_all().close

    def take(self, kind: str, size: int, count: int, warm: int) -> list[float]:
        """Return the seconds of `count` round trips, after `warm` uncounted ones. Raises `NotRunError`."""
        ping, pong = self._ends
        for each in (pong, ping):
            each.write([kind, size, warm + count])
        taken: list[float] = ping.read("taken")
        pong.read("taken")
        return taken[warm:]


def free_port(host: str) -> int:
    """Return a free TCP port."""
    with socket.socket() as free:
        free.bind((host, 0))
        port: int = free.getsockname()[1]
    return port


def end(process: subprocess.Popen[Any]) -> None:
    """Wait until the process ends; kill it after 15 s."""
    try:
        process.wait(END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def guard() -> tuple[str, ...]:
    """Return the command prefix that ends a command with this process, even if that is killed (Linux).

    The ends of the rows and the link don't need it: they end when their standard input is closed.
    """
    return ("setpriv", "--pdeathsig", "TERM") if shutil.which("setpriv") else ()


@contextmanager
def ros_master(host: str, folder: Path) -> Iterator[str]:
    """Start a ROS master and yield its address. Raises `NotRunError`."""
    program = shutil.which("rosmaster")
    if program is None:
        raise NotRunError("there is no 'rosmaster'; install it with 'sudo apt install python3-rosmaster'")
    port = free_port(host)
    address = f"http://{host}:{port}"
    with started([program, "--core", "-p", str(port)], address, host, folder) as process:
        until_open(process, folder, (host, port), "the ROS master")
        yield address


@contextmanager
def rosbridge(sources: str, address: str, host: str, folder: Path) -> Iterator[str]:
    """Start a rosbridge server from its sources and yield its address. Raises `NotRunError`."""
    port = free_port(host)
    command = [sys.executable, str(HERE / "rosbridge.py"), sources, host, str(port)]
    with started(command, address, host, folder) as process:
        until_open(process, folder, (host, port), "the rosbridge server")
        yield f"ws://{host}:{port}"


@contextmanager
def started(
    command: Sequence[str], ros_master: str, host: str, folder: Path
) -> Iterator[subprocess.Popen[bytes]]:
    """Run a ROS program for the duration of the block."""
    environment = {**os.environ, "ROS_MASTER_URI": ros_master, "ROS_IP": host, "ROS_LOG_DIR": str(folder)}
    with (folder / ERRORS).open("wb") as errors:
        process = subprocess.Popen(
            (*guard(), *command), env=environment, stdout=subprocess.DEVNULL, stderr=errors
        )
    try:
        yield process
    finally:
        process.terminate()
        end(process)


def until_open(process: subprocess.Popen[bytes], folder: Path, at: tuple[str, int], what: str) -> None:
    """Wait until the server accepts connections at host and port `at`. Raises `NotRunError`."""
    pause, deadline = threading.Event(), time.monotonic() + START_S
    while True:
        with contextlib.suppress(OSError), socket.create_connection(at, 1.0):
            return
        if process.poll() is not None:
            words = (folder / ERRORS).read_text(encoding="utf-8", errors="replace").strip().splitlines()
            last = f": {words[-1][:200]}" if words else ""
            raise NotRunError(f"{what} ended by itself with exit code {process.returncode}{last}")
        if time.monotonic() > deadline:
            raise NotRunError(f"{what} does not listen at {at[0]}:{at[1]}")
        pause.wait(0.05)


@contextmanager
def around(
    hosts: tuple[str, str],
    elsewhere: tuple[str, ...],
    rosbridge_at: str,
    rosbridge_sources: str,
    python2: str,
    rosnodejs: str,
) -> Iterator[Places]:
    """Yield the environment of all rows, with a ROS master and a rosbridge server where available."""
    missing = {}
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="nep-paper-")))
        places = Places(hosts, elsewhere, folder, python2=python2, rosnodejs=rosnodejs)
        why = why_missing(python2)
        if why:
            missing[ORIGINAL] = why
        try:
            master = stack.enter_context(ros_master(hosts[0], folder))
            places = replace(places, ros_master=master)
        except NotRunError as error:
            missing["rospy"] = str(error)
        why = missing.get("rospy", "") or paper_clients.why_no_rosnodejs(rosnodejs)
        if why:
            missing[paper_clients.ROSNODEJS] = why
        for row in paper_clients.ROWS:
            why = "it is measured in L-local only" if elsewhere else paper_clients.why_missing(row)
            if why:
                missing[row] = why
        try:
            if rosbridge_sources and "rospy" not in missing:
                at = stack.enter_context(rosbridge(rosbridge_sources, places.ros_master, hosts[0], folder))
                places = replace(places, rosbridge=at, rosbridge_master=places.ros_master)
            elif rosbridge_at and not elsewhere:
                running = os.environ.get("ROS_MASTER_URI", ROS_MASTER)
                places = replace(places, rosbridge=rosbridge_at, rosbridge_master=running)
            else:
                missing["rosbridge"] = "no server and no sources of one were given"
        except NotRunError as error:
            missing["rosbridge"] = str(error)
        yield replace(places, missing=missing)
