"""The two commands: ``python3 dev.py demo`` and ``python3 dev.py test``.

Both make everything they need, also on a bare computer: the system libraries of Qt WebEngine (on Debian and
Ubuntu), the virtual environment ``.venv``, the pinned packages in it, and a virtual screen if there is none.

    demo           open Studio with its virtual robot; without a screen it does the main job alone
    test           every check and every test
    check          the same as test; add --fast to leave the tests out
    versions       the library alone, without Qt, and its tests with each Python from 3.10 to 3.13
    fuzz           strange bytes for every parser, a quarter of an hour; -- --minutes 1 takes less
    bench          the benchmarks
    screenshots    the pictures of the README
    guide-pictures the pictures of the guide, in each language
    reference      the pages of docs/api, from the docstrings
    package        the installers of this system and the client libraries, into dist/; -- --system clients
                   builds only the libraries, -- --system windows the Windows installers (by Wine)
    setup          only make the environment

What stands behind the command goes to the program that it starts. Standard library only.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from tools.computer import ROOT, Computer, Trouble, end, timed, venv_python
from tools.fuzz import fuzz
from tools.system_packages import bring_system_packages, bring_test_packages
from tools.versions import environment, pip, versions

PYTHONS = ((3, 10), (3, 13))
SCREEN = "1600x1000x24"

SCRIPTS = {
    "test": ("tools/check.py", "dev"),
    "check": ("tools/check.py", "dev"),
    "bench": ("tools/bench.py", "dev"),
    "screenshots": ("tools/screenshots.py", "dev"),
    "guide-pictures": ("tools/guide_pictures.py", "dev"),
    "reference": ("tools/reference.py", "dev"),
}


# ---- the virtual environment ----------------------------------------------------------------------


def stamp(folder: Path, extra: str) -> str:
    """What the environment must be made of: pyproject.toml, pinned packages, translations."""
    digest = hashlib.sha256()
    made_of = [
        *sorted((folder / "requirements").glob("*.txt")),
        *sorted((folder / "nep").glob("locale/*/*/*.po")),
    ]
    for path in (folder / "pyproject.toml", *made_of):
        digest.update(path.read_bytes())
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
    with timed("installing the pinned packages (the first time some 250 MB are brought)"):
        install(computer, python, extra)
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


def install(computer: Computer, python: Path, extra: str) -> None:
    """Install the pinned packages and this folder: by uv, which takes a third of the time, or else by pip.

    uv knows nothing of pip's settings: a computer that gets its packages elsewhere has pip's way left.
    """
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check", *quiet]
    # A file that is not the one that we tested with is refused, wherever it comes from. Ours has no hash:
    # it is this folder, and what builds it is pinned with the others.
    pinned = ["--require-hashes", "-r", f"requirements/{extra}.txt"]
    uv = [str(python), "-m", "uv", "pip", "install", "--python", str(python), "--no-config", *quiet]
    environ = {"UV_HTTP_RETRIES": "0", "UV_LINK_MODE": "copy"} | dict(computer.environ)
    quickly = (
        [*pip, "--no-deps", "--require-hashes", "-r", "requirements/installer.txt"],
        [*uv, "--compile-bytecode", *pinned],
    )
    if any(computer.do(step, environ, None) != 0 for step in quickly):
        print("· the quick way did not go, see above: now by pip, which takes longer", flush=True)
        if computer.do([*pip, *pinned], computer.environ, None) != 0:
            raise Trouble("the packages could not be installed; pip's own words are above")
    if computer.do([*pip, "--no-deps", "--no-build-isolation", "-e", "."], computer.environ, None) != 0:
        raise Trouble("Studio could not be installed; pip's own words are above")


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
        end(server)


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
        print(
            "· node and npm are missing: tests of nep-js and of original JavaScript programs are skipped",
            flush=True,
        )
    with screen(computer) as environ:
        return computer.do([str(python), path, *arguments], environ, None)


def package(computer: Computer, arguments: Sequence[str]) -> int:
    """Make the packages out of an environment that has only what goes into them; the exit code."""
    folder = ROOT / "build" / "package" / "env"
    python = environment(computer, sys.executable, folder, "package", is_for_oldest=True)
    ours = [*pip(python), "--no-deps", "--no-build-isolation", "--force-reinstall", "."]
    if computer.do(ours, computer.environ, None) != 0:
        raise Trouble("Studio could not be installed; pip's own words are above")
    given = [each for each in arguments if each != "--"]
    return computer.do([str(python), "-m", "installers.package", *given], computer.environ, None)


def run(computer: Computer, command: str, arguments: Sequence[str]) -> int:
    """Prepare this computer and run one command; the exit code of what it started."""
    lowest, highest = PYTHONS
    if not lowest <= computer.version <= highest:
        raise Trouble(
            "Python {}.{} to {}.{} is needed, this is {}.{}".format(*lowest, *highest, *computer.version)
        )
    begin = time.monotonic()
    if command not in {"versions", "fuzz"}:  # which have nothing of Qt's, and so ask nothing of the system
        bring_system_packages(computer)
    if command == "test":
        bring_test_packages(computer)
    if command == "setup":
        make_environment(computer, ROOT, "dev")
        code = 0
    elif command == "versions":
        code = versions(computer, arguments)
    elif command == "fuzz":
        code = fuzz(computer, arguments)
    elif command == "package":
        code = package(computer, arguments)
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
    parser.add_argument("command", choices=["demo", *SCRIPTS, "versions", "fuzz", "package", "setup"])
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
