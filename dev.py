"""Development commands, above all ``python3 dev.py demo`` and ``python3 dev.py test``.

Each command installs what it needs, even on a bare computer: the system libraries of Qt WebEngine (on Debian
and Ubuntu), the virtual environment ``.venv`` with pinned packages, and a virtual screen if there is none.

    demo            open Studio with its virtual robot; without a screen it runs unattended
    test            run all checks and tests
    check           the same as test; add --fast to skip the tests
    versions        test the library without Qt on each Python from 3.10 to 3.13
    fuzz            fuzz all parsers for 15 minutes; -- --minutes 1 is shorter
    bench           run the benchmarks
    screenshots     create the images of the README
    guide-pictures  create the images of the guide in each language
    screens         save images of all panels and sheets: FOLDER --language es
    reference       generate docs/api from the docstrings
    package         build the installers of this system and the client libraries into dist/;
                    -- --system clients builds only the libraries,
                    -- --system windows the Windows installers (with Wine)
    setup           only create the environment

Further arguments are passed on to the program that the command starts. Uses only the standard library.
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

from tools.computer import ROOT, CommandError, Computer, stop_process, timed, venv_python
from tools.fuzz import fuzz
from tools.system_packages import install_system_packages, install_test_packages
from tools.versions import environment, pip, versions

PYTHONS = ((3, 10), (3, 13))
SCREEN = "1600x1000x24"

SCRIPTS = {
    "test": ("tools/check.py", "dev"),
    "check": ("tools/check.py", "dev"),
    "bench": ("tools/bench.py", "dev"),
    "screenshots": ("tools/screenshots.py", "dev"),
    "guide-pictures": ("tools/guide_pictures.py", "dev"),
    "screens": ("tools/screens.py", "dev"),
    "reference": ("tools/reference.py", "dev"),
}


def stamp(folder: Path, extra: str) -> str:
    """Return a digest of the files that the environment depends on: pyproject.toml, pins, translations."""
    digest = hashlib.sha256()
    files = [
        *sorted((folder / "requirements").glob("*.txt")),
        *sorted((folder / "nep").glob("locale/*/*/*.po")),
    ]
    for path in (folder / "pyproject.toml", *files):
        digest.update(path.read_bytes())
    return f"{digest.hexdigest()} {extra}"


def is_fresh(folder: Path, extra: str) -> bool:
    """Return True if the environment is up to date; one with the extra ``dev`` also serves ``studio``."""
    try:
        written = (folder / ".venv" / "nep-stamp").read_text(encoding="utf-8")
    except OSError:
        return False
    return written in {stamp(folder, extra), stamp(folder, "dev")}


def make_environment(computer: Computer, folder: Path, extra: str) -> Path:
    """Create the environment with all pinned packages if needed; return its interpreter."""
    python = venv_python(folder / ".venv", computer.platform)
    if is_fresh(folder, extra) and python.exists():
        return python
    # An interrupted run must not leave a valid stamp.
    (folder / ".venv" / "nep-stamp").unlink(missing_ok=True)
    if not computer.ask([str(python), "-c", "import pip; print(pip.__version__)"]):
        with timed("creating the virtual environment .venv"):
            create = [sys.executable, "-m", "venv", "--clear", str(folder / ".venv")]
            if computer.do(create, computer.environ, None) != 0:
                raise CommandError("the virtual environment couldn't be created; Python's output is above")
    with timed("installing the pinned packages (downloads about 250 MB the first time)"):
        install(computer, python, extra)
    probe = [str(python), "-c", "import PySide6.QtWebEngineWidgets"]
    with timed("checking that Qt WebEngine loads"):
        if computer.do(probe, computer.environ, None) != 0:
            raise CommandError("Qt WebEngine can't be loaded; install the system library named above")
    with timed("compiling Studio to bytecode, for a fast first start"):
        # Compile errors appear on import anyway, and a read-only folder is no problem.
        compile_command = [str(python), "-m", "compileall", "-q", "-x", "node_modules", "app", "nep"]
        computer.do(compile_command, computer.environ, None)
    (folder / ".venv" / "nep-stamp").write_text(stamp(folder, extra), encoding="utf-8")
    return python


def install(computer: Computer, python: Path, extra: str) -> None:
    """Install the pinned packages and this folder with uv, or with pip if that fails.

    uv is three times as fast as pip but ignores pip's configuration, such as another package index.
    """
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check", *quiet]
    # Hashes ensure that the tested files are installed. The project itself is this folder and has no hash;
    # its build dependencies are pinned.
    pinned = ["--require-hashes", "-r", f"requirements/{extra}.txt"]
    uv = [str(python), "-m", "uv", "pip", "install", "--python", str(python), "--no-config", *quiet]
    environ = {"UV_HTTP_RETRIES": "0", "UV_LINK_MODE": "copy"} | dict(computer.environ)
    uv_steps = (
        [*pip, "--no-deps", "--require-hashes", "-r", "requirements/installer.txt"],
        [*uv, "--compile-bytecode", *pinned],
    )
    if any(computer.do(step, environ, None) != 0 for step in uv_steps):
        print("· uv failed, see above; installing with pip, which takes longer", flush=True)
        if computer.do([*pip, *pinned], computer.environ, None) != 0:
            raise CommandError("the packages couldn't be installed; pip's output is above")
    if computer.do([*pip, "--no-deps", "--no-build-isolation", "-e", "."], computer.environ, None) != 0:
        raise CommandError("Studio couldn't be installed; pip's output is above")


@contextlib.contextmanager
def screen(computer: Computer) -> Iterator[dict[str, str]]:
    """Yield the environment variables for programs with windows, on a virtual screen if necessary."""
    environ = dict(computer.environ)
    if computer.root:
        # Chromium's sandbox doesn't run as root. Only for development, never in the product.
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
    """Start a virtual X display and yield its number."""
    program = shutil.which("Xvfb")
    if program is None:
        raise CommandError("no screen was found, and Xvfb is missing; install the package xvfb")
    reader, writer = os.pipe()
    command = [program, "-displayfd", str(writer), "-screen", "0", SCREEN, "-nolisten", "tcp"]
    # In a session of its own, so that Ctrl+C stops the programs that use the display before the display.
    server = subprocess.Popen(command, pass_fds=[writer], start_new_session=True, stderr=subprocess.DEVNULL)
    os.close(writer)
    try:
        with os.fdopen(reader) as output:
            number = output.readline().strip()
        if not number:
            raise CommandError(f"the virtual screen didn't start; run '{program} :99' to see the error")
        yield int(number)
    finally:
        server.terminate()
        stop_process(server)


def demo(computer: Computer, arguments: Sequence[str]) -> int:
    """Open Studio with the virtual robot, unattended without a screen; return its exit code."""
    python = make_environment(computer, ROOT, "studio")
    command = [str(python), "-m", "app", "--demo", *arguments]
    pictures = ROOT / "build" / "demo"
    if not computer.has_screen and "--self-drive" not in arguments:
        print("· no screen found: running Studio unattended on a virtual screen", flush=True)
        command += ["--self-drive", str(pictures)]
    with screen(computer) as environ:
        code = computer.do(command, environ, None)
    if "--self-drive" in command:
        images = sorted(pictures.glob("*.png"))
        print(f"· saved {len(images)} screenshots to {pictures}", flush=True)
    return code


def script(
    computer: Computer,
    name: str,
    arguments: Sequence[str],
    scripts: Mapping[str, tuple[str, str]] = SCRIPTS,
) -> int:
    """Run one of the project's scripts in the environment; return its exit code."""
    path, extra = scripts[name]
    if not (ROOT / path).is_file():
        raise CommandError(f"'{name}' needs '{path}', which doesn't exist in this revision")
    python = make_environment(computer, ROOT, extra)
    if name == "test" and not (computer.which("node") and computer.which("npm")):
        print(
            "· node and npm are missing: tests of nep-js and of original JavaScript programs are skipped",
            flush=True,
        )
    with screen(computer) as environ:
        return computer.do([str(python), path, *arguments], environ, None)


def package(computer: Computer, arguments: Sequence[str]) -> int:
    """Build the packages in an environment with only their dependencies; return the exit code."""
    folder = ROOT / "build" / "package" / "env"
    python = environment(computer, sys.executable, folder, "package", is_for_oldest=True)
    install_command = [*pip(python), "--no-deps", "--no-build-isolation", "--force-reinstall", "."]
    if computer.do(install_command, computer.environ, None) != 0:
        raise CommandError("Studio couldn't be installed; pip's output is above")
    forwarded = [each for each in arguments if each != "--"]
    return computer.do([str(python), "-m", "installers.package", *forwarded], computer.environ, None)


def run(computer: Computer, command: str, arguments: Sequence[str]) -> int:
    """Prepare this computer and run a command; return its exit code."""
    lowest, highest = PYTHONS
    if not lowest <= computer.version <= highest:
        raise CommandError(
            "Python {}.{} to {}.{} is needed; this is {}.{}".format(*lowest, *highest, *computer.version)
        )
    begin = time.monotonic()
    if command not in {"versions", "fuzz"}:  # these don't use Qt and need no system packages
        install_system_packages(computer)
    if command == "test":
        install_test_packages(computer)
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
    """Run the command line and return the exit code: that of the command, or 2 or 130.

    2 means that a requirement is missing or an argument is invalid, 130 that Ctrl+C stopped the command.
    """
    args = sys.argv[1:] if arguments is None else list(arguments)
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("command", choices=["demo", *SCRIPTS, "versions", "fuzz", "package", "setup"])
    command: str = parser.parse_args(args[:1]).command
    # Exit normally, which stops the virtual screen, when the terminal closes or CI cancels the job.
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), lambda number, _frame: sys.exit(128 + number))
    try:
        return run(computer or Computer(), command, args[1:])
    except CommandError as error:
        print(f"dev.py: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nstopped", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
