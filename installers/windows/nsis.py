"""Installer built by NSIS from setup/nep-studio.nsi and generated macros."""

from __future__ import annotations

import os
import re
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePath, PureWindowsPath

from installers.context import Context, PackageError
from installers.windows.version import COPYRIGHT, PUBLISHER, version_numbers

__all__ = ["association_macros", "entry_macros", "make_setup"]

HERE = Path(__file__).resolve().parent
SOURCES = HERE / "setup"
REG_FILE = HERE / "nep-studio.reg"
REG_FOLDER = r"C:\Program Files\NEP Studio"
"""Placeholder for the installation folder in the .reg file."""
CLASSES = "Software\\Classes\\"
PROGRAMS = ("nep-studio.exe", "nep.exe")
UNINSTALLER = "uninstall.exe"
BEHAVIOUR_ICON = "nep-behaviour.ico"
"""Name of the icon file of .nepb files; the .reg file refers to it."""
EXTRA_SPACE_MB = 100
"""Free disk space in MB that is required in addition to the files, for settings and normal operation."""


def quoted(text: str | PurePath, folder: str = "") -> str:
    """Quote text for NSIS.

    Args:
        text: Text or relative path.
        folder: NSIS variable of the folder that contains the path, such as "$INSTDIR"; "" for other
            text.
    """
    escaped = str(text).replace("$", "$$").replace('"', '$\\"')
    return f'"{folder}\\{escaped}"' if folder else f'"{escaped}"'


def entry_macros(frozen: Path) -> str:
    """Return the NSIS macros that unpack the frozen program and list the entries of its top folder.

    Files are sorted for reproducibility, and by type because similar files compress better.
    """
    unpack: list[str] = []
    folder = frozen
    for path in sorted(_files(frozen), key=lambda path: (path.parent, path.suffix, path.name)):
        if path.parent != folder:
            folder = path.parent
            unpack.append(f"SetOutPath {quoted(PureWindowsPath(folder.relative_to(frozen)), '$NewFolder')}")
        unpack.append(f'File "{path}"')  # a local path; NSIS doesn't expand variables in it
    names = [*sorted(path.name for path in frozen.iterdir()), UNINSTALLER]
    return (
        _macro("UnpackEntries", unpack)
        + _macro("ForEachEntry do", [f"!insertmacro ${{do}} {quoted(name)}" for name in names])
        + _macro("ForEachProgram do", [f"!insertmacro ${{do}} {quoted(name)}" for name in PROGRAMS])
    )


def _macro(name: str, lines: Sequence[str]) -> str:
    return "\n".join([f"!macro {name}", *(f"  {line}" for line in lines), "!macroend", "", ""])


def _files(frozen: Path) -> Iterator[Path]:
    return (path for path in frozen.rglob("*") if path.is_file())


def association_macros(reg_file: str) -> str:
    """Return the macros that register and unregister the .nepb file type, from the text of a .reg file.

    The key of a file extension may contain values of other programs, so only Studio's values are
    removed from it. Studio's own keys are removed completely.
    """
    values = list(_values(reg_file))
    registration = [f"WriteRegStr HKCU {quoted(key)} {quoted(name)} {text}" for key, name, text in values]
    removal: list[str] = []
    for key, name, text in values:
        if _root(key).startswith("."):
            removal += [
                f"ReadRegStr $0 HKCU {quoted(key)} {quoted(name)}",
                f"${{If}} $0 == {text}",
                f"  DeleteRegValue HKCU {quoted(key)} {quoted(name)}",
                "${EndIf}",
            ]
    for key in sorted({key for key, _name, _text in values}, reverse=True):  # subkeys first
        if _root(key).startswith("."):
            removal += [
                "ClearErrors",
                f"EnumRegValue $0 HKCU {quoted(key)} 0",
                "${If} ${Errors}",  # no values, not even the default value
                f"  DeleteRegKey /ifempty HKCU {quoted(key)}",
                "${EndIf}",
            ]
        elif key == f"{CLASSES}{_root(key)}":
            removal.append(f"DeleteRegKey HKCU {quoted(key)}")
    return _macro("Associate", registration) + _macro("Dissociate", removal)


def _root(key: str) -> str:
    # The suffix or file type that a key belongs to.
    return key.removeprefix(CLASSES).partition("\\")[0]


def _values(reg_file: str) -> Iterator[tuple[str, str, str]]:
    # Key without its hive, name, and text in NSIS syntax.
    key = ""
    for line in reg_file.splitlines():
        if line.startswith("["):
            key = line.strip("[]").removeprefix("HKEY_CURRENT_USER\\")
        elif match := re.fullmatch(r'(?:@|"((?:[^"\\]|\\.)*)")="((?:[^"\\]|\\.)*)"', line):
            name, text = (re.sub(r"\\(.)", r"\1", part or "") for part in match.groups())
            folder, *others = (quoted(part)[1:-1] for part in text.split(REG_FOLDER))
            yield key, name, '"' + "$INSTDIR".join([folder, *others]) + '"'


def make_setup(context: Context, icon: Path, picture: Path) -> Path:
    """Build the installer of the frozen Studio and return its path.

    Args:
        context: Version and folders.
        icon: Icon of the installer.
        picture: Image of the last page.

    Raises:
        PackageError: NSIS is missing or has failed.
    """
    folder = context.work / "setup"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "entries.nsh").write_text(entry_macros(context.frozen), "utf-8")
    (folder / "association.nsh").write_text(association_macros(REG_FILE.read_text("utf-8")), "utf-8")
    target = context.dist / f"NEP-Studio-{context.version}-setup.exe"
    target.parent.mkdir(exist_ok=True)
    for path in (icon, picture):  # the installer preserves their timestamps
        os.utime(path, (context.epoch, context.epoch))
    size_kb = sum(path.stat().st_size for path in _files(context.frozen)) // 1024
    definitions = {
        "VERSION": context.version,
        "VERSION_NUMBERS": ".".join(map(str, version_numbers(context.version))),
        "PUBLISHER": PUBLISHER,
        "COPYRIGHT": COPYRIGHT,
        "OUTPUT": target,
        "LICENSE": context.root / "LICENSE",
        "ICON": icon,
        "PICTURE": picture,
        "SIZE_KB": size_kb,
        "NEEDED_MB": size_kb // 1024 + EXTRA_SPACE_MB,
    }
    makensis = _makensis()
    option = "/" if sys.platform == "win32" else "-"
    context.run(
        makensis, f"{option}V2", f"{option}INPUTCHARSET", "UTF8", f"{option}X{_target(makensis)}",
        f"{option}X!addincludedir {quoted(folder)}", f"{option}X!addincludedir {quoted(SOURCES)}",
        *(f"{option}D{name}={value}" for name, value in definitions.items()),
        SOURCES / "nep-studio.nsi",
    )  # fmt: skip
    return target


def _makensis() -> Path:
    # Raises PackageError if NSIS is missing.
    usual = Path(os.environ.get("PROGRAMFILES(X86)", "C:/Program Files (x86)")) / "NSIS" / "makensis.exe"
    path = shutil.which("makensis") or (str(usual) if usual.is_file() else None)
    if path is None:
        raise PackageError(
            "NSIS, which builds the installer, is missing: install it with 'sudo apt-get install nsis' "
            "(Debian, Ubuntu) or from https://nsis.sourceforge.io (Windows)"
        )
    return Path(path).resolve()


def _target(makensis: Path) -> str:
    # 64 bit where NSIS supports it (Debian's), otherwise 32 bit, which Wine may be unable to run.
    stubs = (makensis.parent / "Stubs", Path("/usr/share/nsis/Stubs"))
    has_stub = any((folder / "lzma_solid-amd64-unicode").is_file() for folder in stubs)
    return "Target amd64-unicode" if has_stub else "Unicode true"
