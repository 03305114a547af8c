"""Fixtures that run published packages of the original NEP as peers.

The original NEP has fixed ports, so only one test run at a time can use them.
"""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import socket
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import psutil
import pytest

from nep.masters.master import is_running
from tests.interop.port_lock import one_run_at_a_time
from tests.ports import free_port

REPOSITORY = Path(__file__).resolve().parents[2]
CACHE = REPOSITORY / ".cache" / "peers"
SCRIPTS = Path(__file__).parent / "peers"
FIXED_PORTS = (7000, 50000)
PYTHON_PEERS = ("0.5.3.5", "0.5.4.5", "0.5.4.6", "0.5.4.7", "0.5.4.8")
JAVASCRIPT_PEER = "nep-js"
ROSLIB_PEER = "roslib"
JAVASCRIPT = {JAVASCRIPT_PEER: "javascript", ROSLIB_PEER: "roslib"}
"""Peers from npm, each with the folder of its lock file."""
SHARED = "shared"
"""Name of the environment with the packages that all Python peers need."""
MARK = "\x1e"
LONG_S = 60.0
FIRST_S = 600.0


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Raise the time limit.

    The first test of a peer installs it and may wait for the ports of another test run.
    """
    here = f"{Path(__file__).parent}{os.sep}"
    for item in items:
        if str(item.path).startswith(here) and item.get_closest_marker("timeout") is None:
            item.add_marker(pytest.mark.timeout(FIRST_S))


class Program:
    """Process that reads and writes lines of JSON; other lines that it prints are kept as text."""

    def __init__(self, command: Sequence[str], **environment: str) -> None:
        self._said: list[object] = []
        self._printed: list[str] = []
        self._news = threading.Condition()
        self.process = subprocess.Popen(
            list(command),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            env=_environment(environment),
            encoding="utf-8",
            errors="replace",
        )
        self._reader = threading.Thread(target=self._read, name="test-peer-reader", daemon=True)
        self._reader.start()

    def _read(self) -> None:
        for line in self.process.stdout:
            _, mark, said = line.partition(MARK)
            with self._news:
                if mark:
                    self._said.append(json.loads(said))
                else:
                    self._printed.append(line)
                self._news.notify_all()

    def tell(self, value: object) -> None:
        """Send a value to the program."""
        self.process.stdin.write(json.dumps(value) + "\n")
        self.process.stdin.flush()

    @property
    def got(self) -> list[object]:
        """Values that the program has received so far."""
        with self._news:
            return [said["got"] for said in self._said if isinstance(said, dict)]

    @property
    def printed(self) -> str:
        """Output of the program that is not part of the protocol."""
        return "".join(self._printed)

    def wait(self, done: Callable[[], bool], what: str, timeout_s: float = LONG_S) -> None:
        """Wait until a condition on the program's output holds; fail after the timeout."""
        with self._news:
            if not self._news.wait_for(done, timeout_s):
                raise AssertionError(
                    f"{what} did not happen\nsaid: {self._said[-3:]}\n{''.join(self._printed)[-1500:]}"
                )

    def hears(self, value: object, timeout_s: float = LONG_S) -> bool:
        """Return whether the program receives this value within the timeout."""
        with self._news:
            return self._news.wait_for(lambda: {"got": value} in self._said, timeout_s)

    def settle(self, timeout_s: float) -> None:
        """Wait some seconds for effects in other programs, which can't be observed here."""
        with self._news:
            self._news.wait_for(lambda: self.process.poll() is not None, timeout_s)

    def wait_ready(self) -> Program:
        """Wait until the program has opened its sockets."""
        self.wait(lambda: "ready" in self._said, f"{self.process.args} being ready")
        return self

    def kill(self) -> None:
        """Kill the process with SIGKILL and release its resources."""
        self.process.kill()
        self.process.wait(LONG_S)
        self._reader.join(LONG_S)
        for pipe in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(OSError):
                pipe.close()


def _environment(changes: Mapping[str, str]) -> dict[str, str]:
    """Return this process's environment without `PYTHONPATH`, so that a peer imports its own `nep`."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return {**kept, "PYTHONUNBUFFERED": "1", "PYTHONIOENCODING": "utf-8", **changes}


class Peers:
    """Starter of programs of the original NEP. Skips the test when a peer can't be installed."""

    def __init__(self) -> None:
        self._running: list[Program] = []
        self._missing: dict[str, str] = {}

    def start(
        self,
        version: str,
        role: str,
        topic: str,
        msg_type: str = "json",
        *,
        mode: str = "many2many",
        name: str = "",
    ) -> Program:
        """Start a program of `version` (one of `PYTHON_PEERS`, `nep-js` or `native`) with its own node."""
        arguments = [role, topic, msg_type, mode, name or f"{role}_{version.replace('.', '')}"]
        if version == "nep-js":
            return self.run_javascript(version, "javascript_peer.js", arguments)
        if version == "native":
            return self.run_native([str(SCRIPTS / "native_peer.py"), *arguments])
        folder = self._have(version, _install_python)
        return self.run([str(_python_of(folder)), str(SCRIPTS / "python_peer.py"), *arguments])

    def run_javascript(self, peer: str, script: str, arguments: Sequence[str]) -> Program:
        """Start a script in the folder of an npm peer, where it finds the installed packages."""
        copy = self.folder(peer) / script
        shutil.copyfile(SCRIPTS / script, copy)
        return self.run(["node", str(copy), *arguments])

    def folder(self, peer: str) -> Path:
        """Return the folder in which an npm peer is installed."""
        return self._have(peer, _install_javascript)

    def run_native(self, arguments: Sequence[str]) -> Program:
        """Start a Python program with the `nep` of this repository."""
        return self.run([sys.executable, *arguments], PYTHONPATH=str(REPOSITORY))

    def run(self, command: Sequence[str], **environment: str) -> Program:
        """Start any program that uses the same protocol of JSON lines."""
        self._running.append(Program(command, **environment))
        return self._running[-1]

    def _have(self, version: str, install: Callable[[str, Path], str]) -> Path:
        folder = CACHE / version
        if version not in self._missing:
            self._missing[version] = "" if _is_complete(version) else install(version, folder)
        if self._missing[version]:
            pytest.skip(self._missing[version])
        return folder

    def close(self) -> None:
        """Kill all programs."""
        for program in self._running:
            program.kill()
        self._running.clear()


def _python_of(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def _install_python(version: str, folder: Path) -> str:
    """Install one version in its own environment, which also sees the shared large packages."""
    missing = "" if _is_complete(SHARED) else _make_python(SHARED, CACHE / SHARED)
    return missing or _make_python(version, folder, sees=CACHE / SHARED)


def _make_python(version: str, folder: Path, sees: Path | None = None) -> str:
    shutil.rmtree(folder, ignore_errors=True)
    python = _python_of(folder)
    into = [sys.executable, "-m", "pip", "--python", str(python), "install", "--quiet", "--no-deps"]
    trial = "import nep; nep.node" if sees else "import cv2, zmq"
    problem = _run_all([[sys.executable, "-m", "venv", "--without-pip", str(folder)]], version, folder)
    if not problem and sees is not None:
        own = _packages_in(folder)
        own.mkdir(parents=True, exist_ok=True)
        (own / "shared.pth").write_text(os.path.relpath(_packages_in(sees), own) + "\n", "utf-8")
    rest = ([*into, "--require-hashes", "-r", str(_pins(version))], [str(python), "-c", trial])
    return problem or _run_all(rest, version, folder, is_complete=True)


def _packages_in(folder: Path) -> Path:
    """Return the site-packages folder of an environment."""
    scheme = {"base": str(folder), "platbase": str(folder)}
    layout = "venv" if "venv" in sysconfig.get_scheme_names() else sysconfig.get_default_scheme()
    return Path(sysconfig.get_path("purelib", layout, scheme))


def _install_javascript(version: str, folder: Path) -> str:
    if shutil.which("node") is None or shutil.which("npm") is None:
        return f"the test peer {version} needs node and npm, which this computer does not have"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copy(_pins(version).with_name(name), folder)
    npm = shutil.which("npm") or "npm"
    commands = (
        [npm, "ci", "--silent", "--no-audit", "--no-fund", "--prefix", str(folder)],
        ["node", "--input-type=module", "-e", f"await import({json.dumps(version)})"],
    )
    return _run_all(commands, version, folder, is_complete=True, where=folder)


def _is_complete(version: str) -> bool:
    """Return whether the environment of a peer exists and matches its current pins."""
    done = CACHE / version / "complete"
    return done.is_file() and done.read_text("utf-8") == _packages(version)


def _pins(version: str) -> Path:
    """Return the file with the pinned packages and hashes of a peer."""
    if version in JAVASCRIPT:
        return SCRIPTS / JAVASCRIPT[version] / "package-lock.json"
    if version == SHARED:
        return SCRIPTS / "python.txt"
    return SCRIPTS / f"nep-{version}.txt"


def _packages(version: str) -> str:
    """Return the pins of a peer's environment; the environment is rebuilt when they change."""
    common = SCRIPTS / "python.txt"
    return _pins(version).read_text("utf-8") + common.read_text("utf-8")


def _run_all(
    commands: Sequence[Sequence[str]],
    version: str,
    folder: Path,
    *,
    is_complete: bool = False,
    where: Path | None = None,
) -> str:
    """Run the commands that install a peer. Return the reason for a failure, or an empty text."""
    what = "what the test peers need" if version == SHARED else f"the test peer nep {version}"
    if version in JAVASCRIPT:
        what = f"the test peer {version}"
    where = where or folder.parent  # not the current folder: `import nep` would find this repository
    where.mkdir(parents=True, exist_ok=True)
    for command in commands:
        try:
            subprocess.run(
                command,
                check=True,
                capture_output=True,
                text=True,
                timeout=240,
                cwd=where,
                env=_environment({}),
            )
        except subprocess.CalledProcessError as error:
            lines = (error.stderr or error.stdout).strip().splitlines() or ["no reason given"]
            return f"{what} could not be installed: {lines[-1]}"
        except (OSError, subprocess.TimeoutExpired) as error:
            return f"{what} could not be installed: {error}"
    if is_complete:
        (folder / "complete").write_text(_packages(version), "utf-8")
    return ""


@pytest.fixture(scope="session")
def fixed_ports() -> Iterator[None]:
    """Fixed ports of the original NEP, locked for this test run; fails if another program uses one."""
    with one_run_at_a_time():
        for port in FIXED_PORTS:
            with socket.socket() as probe:
                probe.settimeout(5)
                if probe.connect_ex(("127.0.0.1", port)) == 0:
                    pytest.fail(
                        f"port {port} is taken by another program; close it and run the interop tests again"
                    )
        yield


@pytest.fixture
def peers(fixed_ports: None) -> Iterator[Peers]:
    """Programs of the original NEP, killed after the test."""
    started = Peers()
    yield started
    started.close()


@pytest.fixture
def nep_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Separate master address and state folder for one test."""
    address = f"127.0.0.1:{free_port()}"
    monkeypatch.setenv("NEP_MASTER", address)
    monkeypatch.setenv("NEP_STATE_DIR", str(tmp_path / "state"))
    return address


@pytest.fixture
def master(peers: Peers, nep_home: str) -> Program:
    """Process of `nep master` with its gateway."""
    return start_master(peers, nep_home)


@pytest.fixture
def start_again(peers: Peers, nep_home: str) -> Callable[[], Program]:
    """Function that restarts the master after it was killed."""
    return lambda: start_master(peers, nep_home)


def start_master(peers: Peers, address: str) -> Program:
    """Start `nep master` and wait until it replies and has bound the fixed ports."""
    program = peers.run_native(["-m", "nep", "master"])
    if not is_running(address, LONG_S):
        raise AssertionError(f"the master does not answer\n{program.printed}")
    bound = {each.laddr.port for each in psutil.Process(program.process.pid).net_connections("tcp")}
    if not bound.issuperset(FIXED_PORTS):
        pytest.fail(
            "another program took port 7000 or 50000 meanwhile; close it and run the interop tests again"
        )
    return program
