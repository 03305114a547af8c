"""Fake application bundle in PyInstaller's layout, with Mach-O headers for code, and fake signing tools."""

from __future__ import annotations

import json
import plistlib
import struct
from collections.abc import Sequence
from pathlib import Path

from installers.context import Context
from installers.macos.information import APP_ICON, DOCUMENT_ICON, information, write_localised_texts

VERSION = "0.1.0"
PROGRAM, LIBRARY = 2, 6
CPUS = {"x86_64": 0x01000007, "arm64": 0x0100000C}
ICON = b"icns" + struct.pack(">I", 16) + b"ic07" + struct.pack(">I", 8)

TOOL = """#!{python}
import json, os, sys
from pathlib import Path
name = Path(sys.argv[0]).name
with open({log!r}, "a", encoding="utf-8") as file:
    file.write(json.dumps([name, *sys.argv[1:]]) + "\\n")
if sys.argv[1:3] == ["notarytool", "submit"]:
    print(json.dumps({{"id": "17", "status": {status!r}}}))
elif sys.argv[1:3] == ["notarytool", "log"]:
    print("the signature has no secure time stamp")
sys.exit({code} if name == {fails!r} else 0)
"""


def header(
    kind: int = LIBRARY, machine: str = "arm64", macos: tuple[int, int] = (13, 0), needs: Sequence[str] = ()
) -> bytes:
    version = macos[0] << 16 | macos[1] << 8
    commands = struct.pack("<6I", 0x32, 24, 1, version, version, 0)
    for name in ("/usr/lib/libSystem.B.dylib", *needs):
        text = name.encode() + b"\0"
        text += bytes(-len(text) % 8)
        commands += struct.pack("<6I", 0xC, 24 + len(text), 24, 2, 0, 0) + text
    head = (0xFEEDFACF, CPUS[machine], 0, kind, 2 + len(needs), len(commands), 0, 0)
    return struct.pack("<8I", *head) + commands


def fat(*slices: bytes) -> bytes:
    start, entries, body = 4096, b"", b""
    for each in slices:
        (cpu,) = struct.unpack_from("<I", each, 4)
        entries += struct.pack(">5I", cpu, 0, start + len(body), len(each), 12)
        body += each
    head = struct.pack(">2I", 0xCAFEBABE, len(slices)) + entries
    return head.ljust(start, b"\0") + body


def put(path: Path, content: bytes = b"data", mode: int = 0o644) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    path.chmod(mode)
    return path


def link(path: Path, target: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.symlink_to(target)


def framework(folder: Path, name: str) -> Path:
    """Create a framework with the layout that PyInstaller gives those of PySide6's wheels."""
    root = folder / f"{name}.framework"
    put(root / "Versions" / "A" / name, fat(header(), header(machine="x86_64")), 0o755)
    put(root / "Versions" / "A" / "Resources" / "Info.plist", plistlib.dumps({"CFBundleIdentifier": name}))
    link(root / "Versions" / "Current", "A")
    link(root / name, f"Versions/Current/{name}")
    link(root / "Resources", "Versions/Current/Resources")
    return root


def web_engine(folder: Path) -> Path:
    root = framework(folder, "QtWebEngineCore")
    inside = root / "Versions" / "A"
    for name in ("icudtl.dat", "qtwebengine_resources.pak", "qtwebengine_locales/en-US.pak"):
        put(inside / "Resources" / name)
    process = inside / "Helpers" / "QtWebEngineProcess.app" / "Contents"
    put(process / "MacOS" / "QtWebEngineProcess", header(PROGRAM), 0o755)
    put(process / "Info.plist", plistlib.dumps({"CFBundleExecutable": "QtWebEngineProcess"}))
    link(root / "Helpers", "Versions/Current/Helpers")
    return root


def made_up_app(folder: Path) -> Path:
    app = folder / "NEP Studio.app"
    contents = app / "Contents"
    put(contents / "Info.plist", plistlib.dumps(information(VERSION, "arm64")))
    needs = ["@rpath/libpython3.13.dylib", "@rpath/QtCore.framework/Versions/A/QtCore"]
    put(contents / "MacOS" / "nep-studio", header(PROGRAM, needs=needs), 0o755)
    put(contents / "MacOS" / "nep", header(PROGRAM), 0o755)
    frameworks, resources = contents / "Frameworks", contents / "Resources"
    put(frameworks / "libpython3.13.dylib", header(), 0o755)
    link(resources / "libpython3.13.dylib", "../Frameworks/libpython3.13.dylib")
    put(frameworks / "numpy" / "__dot__dylibs" / "libopenblas.dylib", header(), 0o755)
    link(frameworks / "numpy" / ".dylibs", "__dot__dylibs")
    put(resources / "base_library.zip")
    link(frameworks / "base_library.zip", "../Resources/base_library.zip")
    for language in ("es", "fr", "ja"):
        put(resources / "nep" / "locale" / language / "LC_MESSAGES" / "nep-studio.mo")
    link(frameworks / "nep", "../Resources/nep")
    qt = frameworks / "PySide6" / "Qt" / "lib"
    framework(qt, "QtCore")
    web_engine(qt)
    link(resources / "PySide6", "../Frameworks/PySide6")
    put(resources / APP_ICON, ICON)
    put(resources / DOCUMENT_ICON, ICON)
    write_localised_texts(resources)
    return app


def context(folder: Path) -> Context:
    return Context("macos", root=folder, version=VERSION, machine="arm64", epoch=1_700_000_000)


def noting_tools(folder: Path, python: str, status: str = "Accepted", fails: str = "", code: int = 3) -> Path:
    """Install fake codesign, xcrun, ditto and spctl in a folder. Return the log file of their arguments."""
    folder.mkdir()
    log = folder / "calls.jsonl"
    log.touch()
    text = TOOL.format(python=python, log=str(log), status=status, fails=fails, code=code)
    for name in ("codesign", "xcrun", "ditto", "spctl"):
        put(folder / name, text.encode(), 0o755)
    return log


def calls(log: Path) -> list[list[str]]:
    return [json.loads(line) for line in log.read_text("utf-8").splitlines()]
