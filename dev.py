"""The two commands: ``python3 dev.py demo`` and ``python3 dev.py test``.

Both make everything they need, also on a bare computer: the system libraries of Qt WebEngine (on Debian and
Ubuntu), the virtual environment ``.venv``, the pinned packages in it, and a virtual screen if there is none.

    demo           open Studio with its virtual robot; without a screen it does the main job alone
    test           every check and every test
    check          the same as test; add --fast to leave the tests out
    bench          the benchmarks
    screenshots    the pictures of the README
    setup          only make the environment

What stands behind the command goes to the program that it starts. Standard library only.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PYTHONS = ((3, 10), (3, 13))
SCREEN = "1600x1000x24"
END_S = 10.0

# A name may have changed between releases of Debian and Ubuntu: the first one that can be had is taken.
QT_LIBRARIES = (
    "libgl1",
    "libegl1",
    "libxkbcommon0",
    "libdbus-1-3",
    "libfontconfig1",
    "libglib2.0-0t64|libglib2.0-0",
    "libnss3",
    "libnspr4",
    "libasound2t64|libasound2",
    "libxcomposite1",
    "libxdamage1",
    "libxrandr2",
    "libxtst6",
    "libxkbfile1",
    "libxcb-cursor0",
    "libxcb-icccm4",
    "libxcb-keysyms1",
    "libxcb-image0",
    "libxcb-render-util0",
    "libxcb-shape0",
    "libxcb-xkb1",
    "libxcb-randr0",
    "libxcb-sync1",
    "libxcb-xfixes0",
    "libxkbcommon-x11-0",
    "libx11-xcb1",
)

SCRIPTS = {
    "test": ("tools/check.py", "dev"),
    "check": ("tools/check.py", "dev"),
    "bench": ("tools/bench.py", "dev"),
    "screenshots": ("tools/screenshots.py", "dev"),
}


class Trouble(Exception):  # noqa: N818 (not a fault of this program, but of the computer it runs on)
    """Something is missing that a person must bring; its text says what to do."""


def _ask(command: Sequence[str]) -> str:
    """What a command prints in English; nothing when it cannot run."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, env={**os.environ, "LC_ALL": "C"}
        )
    except OSError:
        return ""
    return done.stdout


def watch(command: Sequence[str], environ: Mapping[str, str], log: Path | None = None) -> int:
    """Run a command to its end and return its exit code; what it says goes to the person, or into `log`.

    Ctrl+C reaches the command too (it is in our terminal's group): it may end in its own order, but must end.
    """
    with open(log, "ab") if log else contextlib.nullcontext() as output:  # noqa: PTH123 (a path or nothing)
        process = subprocess.Popen(command, cwd=ROOT, env=dict(environ), stdout=output, stderr=output)
        try:
            return process.wait()
        except BaseException:
            _end(process)
            raise


def _end(process: subprocess.Popen[bytes]) -> None:
    """See a process end: by itself, else asked, else killed; END_S in all."""
    for end in (process.terminate, process.kill):
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_S / 2)
            return
        end()


@dataclass(frozen=True)
class Computer:
    """What we run on, and the only way that we touch it."""

    platform: str = sys.platform
    environ: Mapping[str, str] = field(default_factory=lambda: dict(os.environ))
    root: bool = hasattr(os, "geteuid") and os.geteuid() == 0
    version: tuple[int, int] = sys.version_info[:2]
    has_ensurepip: bool = importlib.util.find_spec("ensurepip") is not None
    which: Callable[[str], str | None] = shutil.which
    ask: Callable[[Sequence[str]], str] = _ask
    do: Callable[[Sequence[str], Mapping[str, str], Path | None], int] = watch

    @property
    def has_apt(self) -> bool:
        """Whether this is Debian, Ubuntu or a relative."""
        return self.platform == "linux" and bool(self.which("apt-get") and self.which("dpkg-query"))

    @property
    def has_screen(self) -> bool:
        """Whether windows can be shown to a person (Windows and macOS: always)."""
        return self.platform != "linux" or bool(
            self.environ.get("DISPLAY") or self.environ.get("WAYLAND_DISPLAY")
        )


@contextlib.contextmanager
def timed(what: str) -> Iterator[None]:
    """Say what is being done, and how long it took."""
    print(f"· {what} …", flush=True)
    begin = time.monotonic()
    yield
    print(f"  done in {time.monotonic() - begin:.1f} s", flush=True)


# ---- system packages ------------------------------------------------------------------------------


def wanted_packages(computer: Computer) -> list[str]:
    """The system packages that this computer must have, with ``|`` between names that mean the same."""
    wanted = list(QT_LIBRARIES)
    if not computer.has_screen:
        wanted.append("xvfb")
    if not computer.has_ensurepip:
        wanted.append("python{}.{}-venv".format(*computer.version))
    return wanted


def missing_packages(computer: Computer) -> list[str]:
    """Those of `wanted_packages` of which no name is installed."""
    wanted = wanted_packages(computer)
    names = [name for entry in wanted for name in entry.split("|")]
    lines = computer.ask(["dpkg-query", "-W", "-f", "${Package} ${db:Status-Status}\n", *names]).splitlines()
    installed = {line.split()[0] for line in lines if line.endswith(" installed")}
    return [entry for entry in wanted if installed.isdisjoint(entry.split("|"))]


def available(computer: Computer, entries: Sequence[str]) -> tuple[list[str], list[str]]:
    """For each entry the first name that apt can bring, and the entries for which it knows none."""
    names = [name for entry in entries for name in entry.split("|")]
    can: set[str] = set()
    name = ""
    for line in computer.ask(["apt-cache", "policy", *names]).splitlines():
        if line and not line.startswith(" "):
            name = line.rstrip(":").split(":")[0]
        elif line.strip().startswith("Candidate:") and "(none)" not in line:
            can.add(name)
    found = [next((name for name in entry.split("|") if name in can), "") for entry in entries]
    unknown = [entry for entry, name in zip(entries, found, strict=True) if not name]
    return [name for name in found if name], unknown


def bring_system_packages(computer: Computer) -> None:
    """Install what is missing (root), or raise Trouble with the one line to type."""
    if not computer.has_apt:
        return
    missing = missing_packages(computer)
    if not missing:
        return
    names, unknown = available(computer, missing)
    if not computer.root:
        line = " ".join(sorted([*names, *(entry.split("|")[-1] for entry in unknown)]))
        raise Trouble(
            "some system libraries are missing; type this one line, then start me again:\n"
            f"  sudo apt-get update && sudo apt-get install -y --no-install-recommends {line}"
        )
    with timed(f"bringing {len(missing)} system packages with apt (the first time some 70 MB)"):
        apt_install(computer, missing, names, unknown)


def apt_install(computer: Computer, missing: Sequence[str], names: list[str], unknown: list[str]) -> None:
    """Install `names` as root; raises Trouble with apt's own last words when it cannot."""
    log = ROOT / "build" / "apt.log"
    log.parent.mkdir(exist_ok=True)
    log.unlink(missing_ok=True)
    environ = {**computer.environ, "DEBIAN_FRONTEND": "noninteractive"}
    apt = ["apt-get", "-q", "-o", "DPkg::Lock::Timeout=600", "-o", "Dpkg::Use-Pty=0"]
    install = [*apt, "install", "-y", "--no-install-recommends"]
    if not unknown and computer.do([*install, *names], environ, log) == 0:
        return
    # Only now: the package lists are absent, or older than what the servers still have.
    computer.do([*apt, "update"], environ, log)
    names, unknown = available(computer, missing)
    if unknown:
        raise Trouble(
            f"apt knows no package for {', '.join(unknown)}; is its list of servers complete? ('{log}')"
        )
    if computer.do([*install, *names], environ, log) != 0:
        words = "".join(log.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)[-12:])
        raise Trouble(f"apt could not install the system libraries ('{log}'); its last words:\n{words}")


# ---- the virtual environment ----------------------------------------------------------------------


def venv_python(folder: Path, platform: str) -> Path:
    """The interpreter in a virtual environment."""
    return folder / ("Scripts/python.exe" if platform == "win32" else "bin/python")


def stamp(folder: Path, extra: str) -> str:
    """What the environment must be made of: changes when pyproject.toml or constraints.txt does."""
    digest = hashlib.sha256()
    for name in ("pyproject.toml", "constraints.txt"):
        digest.update((folder / name).read_bytes())
    return f"{digest.hexdigest()} {extra}"


def is_fresh(folder: Path, extra: str) -> bool:
    """Whether the environment was made from these very files; ``dev`` holds all that ``studio`` does."""
    try:
        written = (folder / ".venv" / "nep-stamp").read_text(encoding="utf-8")
    except OSError:
        return False
    return written in {stamp(folder, extra), stamp(folder, "dev")}


def make_environment(computer: Computer, folder: Path, extra: str) -> Path:
    """The interpreter of an environment with everything pinned installed in it."""
    python = venv_python(folder / ".venv", computer.platform)
    if is_fresh(folder, extra) and python.exists():
        return python
    # What is not finished must not look finished.
    (folder / ".venv" / "nep-stamp").unlink(missing_ok=True)
    if not computer.ask([str(python), "-c", "import pip; print(pip.__version__)"]):
        with timed("making the virtual environment .venv"):
            make = [sys.executable, "-m", "venv", "--clear", str(folder / ".venv")]
            if computer.do(make, computer.environ, None) != 0:
                raise Trouble("the virtual environment could not be made; Python's own words are above")
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check", *quiet]
    with timed("installing the pinned packages (the first time some 250 MB are brought)"):
        if computer.do([*pip, "-c", "constraints.txt", "-e", f".[{extra}]"], computer.environ, None) != 0:
            raise Trouble("the packages could not be installed; pip's own words are above")
    probe = [str(python), "-c", "import PySide6.QtWebEngineWidgets"]
    with timed("loading Qt WebEngine once"):
        if computer.do(probe, computer.environ, None) != 0:
            raise Trouble("Qt WebEngine does not load; the library named above is missing on this computer")
    with timed("compiling Studio, so that its first start is as quick as the later ones"):
        # What can't be compiled says so when it is imported; a folder that can't be written is no trouble.
        compile_ours = [str(python), "-m", "compileall", "-q", "-x", "node_modules", "app", "nep"]
        computer.do(compile_ours, computer.environ, None)
    (folder / ".venv" / "nep-stamp").write_text(stamp(folder, extra), encoding="utf-8")
    return python


# ---- the screen -----------------------------------------------------------------------------------


@contextlib.contextmanager
def screen(computer: Computer) -> Iterator[dict[str, str]]:
    """The environment of a program with windows; where there is no screen, a virtual one lives as long."""
    environ = dict(computer.environ)
    if computer.root:
        # Chromium refuses to run as root with its sandbox. Only here: never in the product.
        environ["QTWEBENGINE_DISABLE_SANDBOX"] = "1"
    if computer.has_screen:
        yield environ
        return
    with tempfile.TemporaryDirectory(prefix="nep-") as runtime, virtual_screen() as number:
        environ.update(DISPLAY=f":{number}", QT_QUICK_BACKEND="software")
        environ.setdefault("XDG_RUNTIME_DIR", runtime)
        yield environ


@contextlib.contextmanager
def virtual_screen() -> Iterator[int]:
    """The number of an X display of our own, which ends with the block."""
    program = shutil.which("Xvfb")
    if program is None:
        raise Trouble("there is no screen, and no Xvfb to make a virtual one; install the package xvfb")
    reader, writer = os.pipe()
    command = [program, "-displayfd", str(writer), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    # In a session of its own, so that Ctrl+C ends the program that draws on it first.
    server = subprocess.Popen(command, pass_fds=[writer], start_new_session=True, stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with os.fdopen(reader) as answer:
            number = answer.readline().strip()
        if not number:
            raise Trouble(f"the virtual screen did not start; try '{program} :99' to see why")
        yield int(number)
    finally:
        server.terminate()
        _end(server)


# ---- the commands ---------------------------------------------------------------------------------


def demo(computer: Computer, arguments: Sequence[str]) -> int:
    """Open Studio with the virtual robot, or without a screen let it drive itself; its exit code."""
    python = make_environment(computer, ROOT, "studio")
    command = [str(python), "-m", "app", "--demo", *arguments]
    pictures = ROOT / "build" / "demo"
    if not computer.has_screen and "--self-drive" not in arguments:
        print("· no screen here: Studio runs on a virtual one and does the main job alone", flush=True)
        command += ["--self-drive", str(pictures)]
    with screen(computer) as environ:
        code = computer.do(command, environ, None)
    if "--self-drive" in command:
        made = sorted(pictures.glob("*.png"))
        print(f"· {len(made)} pictures of the window are in {pictures}", flush=True)
    return code


def script(
    computer: Computer,
    name: str,
    arguments: Sequence[str],
    scripts: Mapping[str, tuple[str, str]] = SCRIPTS,
) -> int:
    """Run one of the project's own scripts in the environment; its exit code."""
    path, extra = scripts[name]
    if not (ROOT / path).is_file():
        raise Trouble(f"'{name}' needs '{path}', which this revision does not have")
    python = make_environment(computer, ROOT, extra)
    if name == "test" and not (computer.which("node") and computer.which("npm")):
        print("· no node and npm here: the interop tests with programs in JavaScript are skipped", flush=True)
    with screen(computer) as environ:
        return computer.do([str(python), path, *arguments], environ, None)


def run(computer: Computer, command: str, arguments: Sequence[str]) -> int:
    """Prepare this computer and run one command; the exit code of what it started."""
    lowest, highest = PYTHONS
    if not lowest <= computer.version <= highest:
        raise Trouble(
            "Python {}.{} to {}.{} is needed, this is {}.{}".format(*lowest, *highest, *computer.version)
        )
    begin = time.monotonic()
    bring_system_packages(computer)
    if command == "setup":
        make_environment(computer, ROOT, "dev")
        code = 0
    elif command == "demo":
        code = demo(computer, arguments)
    else:
        code = script(computer, command, arguments)
    print(
        f"· {command}: {'ok' if code == 0 else f'exit code {code}'}, {time.monotonic() - begin:.1f} s",
        file=sys.stderr,
    )
    return code


def main(arguments: Sequence[str] | None = None, computer: Computer | None = None) -> int:
    """The command line: 0 well, 1 not well, 2 something is missing, 130 after Ctrl+C."""
    given = sys.argv[1:] if arguments is None else list(arguments)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=["demo", *SCRIPTS, "setup"])
    command: str = parser.parse_args(given[:1]).command
    # A terminal that closes, or a CI that gives up, must not leave a virtual screen behind.
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda number, _frame: sys.exit(128 + number))
    try:
        return run(computer or Computer(), command, given[1:])
    except Trouble as trouble:
        print(f"dev.py: {trouble}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
