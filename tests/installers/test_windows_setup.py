"""Tests of the setup program under Wine: installation, update, failures and removal."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from tests.installers.small_setup import frozen_program, setup_of

COMPILER = "x86_64-w64-mingw32-gcc"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.long,
    pytest.mark.skipif(
        not sys.platform.startswith("linux")
        or any(
            shutil.which(each) is None for each in ("wine", "wineboot", "wineserver", "makensis", COMPILER)
        ),
        reason="needs wine, nsis and mingw",
    ),
]
IMPOSSIBLE, OPEN = 2, 3
UNINSTALL = r"HKCU\Software\Microsoft\Windows\CurrentVersion\Uninstall\NEP Studio"
CLASSES = r"HKCU\Software\Classes"
PROGRAM = """
#include <stdio.h>
int main(void) { puts("started"); fflush(stdout); getchar(); return 0; }
"""
LONG_PATH = ";".join(rf"C:\\Some folder\\{number}" for number in range(200))


@dataclass(frozen=True)
class Windows:
    """Windows of a Wine prefix, with the setup programs of two versions."""

    prefix: Path
    setups: dict[str, Path] = field(default_factory=dict)

    @property
    def environ(self) -> dict[str, str]:
        """Environment variables for programs that run under Wine."""
        return {
            **{name: text for name, text in os.environ.items() if name != "DISPLAY"},
            "WINEPREFIX": str(self.prefix),
            "WINEDEBUG": "-all",
            "WINEDLLOVERRIDES": "mscoree,mshtml,winemenubuilder.exe=",
            "LC_ALL": "C.UTF-8",
        }

    @property
    def local(self) -> Path:
        """Folder of the user's local application data."""
        (user,) = [each for each in (self.prefix / "drive_c/users").iterdir() if each.name != "Public"]
        return user / "AppData" / "Local"

    @property
    def folder(self) -> Path:
        """Folder in which Studio is installed."""
        return self.local / "Programs" / "NEP Studio"

    def run(self, *command: str | Path) -> tuple[int, str]:
        """Run a Windows program and return its exit code and output."""
        done = subprocess.run(
            ["wine", *map(str, command)],
            env=self.environ, stdout=subprocess.PIPE, stdin=subprocess.DEVNULL, check=False,
        )  # fmt: skip
        return done.returncode, done.stdout.decode("utf-8", "replace")

    @contextlib.contextmanager
    def running(self, *command: Path) -> Iterator[None]:
        """Run a program for the duration of a block; it reports its start and is stopped at the end."""
        words = ["wine", *map(str, command)]
        started = subprocess.Popen(words, env=self.environ, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        assert started.stdout is not None
        assert started.stdout.readline().strip() == b"started"
        yield
        started.communicate(b"\n")
        subprocess.run(["wineserver", "--wait"], env=self.environ, check=True)

    def uninstall(self) -> None:
        """Remove Studio silently and wait until all processes have ended."""
        self.run(self.folder / "uninstall.exe", "/S")
        subprocess.run(["wineserver", "--wait"], env=self.environ, check=True)

    def registry(self, key: str, name: str | None = None) -> str:
        """Return a value of the registry, or an empty text if it doesn't exist."""
        which = ["/ve"] if name is None else ["/v", name]
        _code, said = self.run("reg", "query", key, *which)
        lines = [line.split("    ", 3) for line in said.splitlines() if "    REG_" in line]
        return lines[0][3].strip() if lines and len(lines[0]) > 3 else ""

    def path(self) -> str:
        """PATH variable of the user."""
        return self.registry(r"HKCU\Environment", "Path")


@pytest.fixture(scope="module")
def computer(tmp_path_factory: pytest.TempPathFactory) -> Windows:
    """Windows with two versions of the setup. Created once for all tests, because it takes long."""
    folder = tmp_path_factory.mktemp("windows")
    (folder / "program.c").write_text(PROGRAM, "utf-8")
    program = folder / "program.exe"
    subprocess.run([COMPILER, "-s", "-o", program, folder / "program.c"], check=True)
    made = Windows(folder / "prefix")
    for version in ("1.2.3", "1.3.0"):
        made.setups[version] = setup_of(frozen_program(folder / version, version, program.read_bytes()))
    subprocess.run(["wineboot", "--init"], env=made.environ, check=True)
    subprocess.run(["wineserver", "--wait"], env=made.environ, check=True)
    return made


@pytest.fixture
def windows(computer: Windows) -> Iterator[Windows]:
    """Windows with version 1.2.3 of Studio installed; it is removed after the test."""
    assert computer.run(computer.setups["1.2.3"], "/S") == (0, "")
    yield computer
    if (computer.folder / "uninstall.exe").exists():
        computer.uninstall()
    shutil.rmtree(computer.local / "Programs", ignore_errors=True)


def test_install_registers_studio_and_uninstall_removes_all_but_user_files(windows: Windows) -> None:
    work = windows.local / "nep-studio" / "kept" / "mine.nepb"
    work.parent.mkdir(parents=True)
    work.write_text("{}", "utf-8")
    assert sorted(path.name for path in windows.folder.iterdir()) == [
        "_internal", "nep-studio.exe", "nep.exe", "uninstall.exe",
    ]  # fmt: skip
    assert (windows.folder / "_internal/ñ x/text.txt").is_file()
    command = windows.registry(rf"{CLASSES}\NEPStudio.Behaviour\shell\open\command")
    assert command.endswith(r'\AppData\Local\Programs\NEP Studio\nep-studio.exe" "%1"')
    assert windows.registry(rf"{CLASSES}\.nepb") == "NEPStudio.Behaviour"
    assert windows.registry(UNINSTALL, "DisplayVersion") == "1.2.3"
    assert list(windows.prefix.rglob("NEP Studio.lnk"))
    windows.uninstall()
    assert work.read_text("utf-8") == "{}"
    assert not windows.folder.exists()
    assert not list(windows.prefix.rglob("NEP Studio.lnk"))
    assert windows.registry(rf"{CLASSES}\.nepb") == ""
    assert windows.registry(UNINSTALL, "DisplayVersion") == ""
    assert "nep-studio" not in (windows.prefix / "user.reg").read_text("utf-8")


def test_uninstall_keeps_a_foreign_file_association(windows: Windows) -> None:
    windows.run("reg", "add", rf"{CLASSES}\.nepb", "/ve", "/d", "Other.Program", "/f")
    windows.uninstall()
    assert windows.registry(rf"{CLASSES}\.nepb") == "Other.Program"
    windows.run("reg", "delete", rf"{CLASSES}\.nepb", "/f")


def test_update_replaces_the_old_version_and_keeps_foreign_files(windows: Windows) -> None:
    (windows.folder / "mine.txt").write_text("mine", "utf-8")
    assert windows.run(windows.setups["1.3.0"], "/S") == (0, "")
    assert windows.registry(UNINSTALL, "DisplayVersion") == "1.3.0"
    assert (windows.folder / "_internal/a.dll").read_text("utf-8") == "_internal/a.dll 1.3.0"
    assert not (windows.folder / "old~").exists()
    windows.uninstall()
    assert [path.name for path in windows.folder.iterdir()] == ["mine.txt"]


def test_update_and_uninstall_are_rejected_while_studio_is_open(windows: Windows) -> None:
    with windows.running(windows.folder / "nep-studio.exe"):
        code, said = windows.run(windows.setups["1.3.0"], "/S")
        assert code == OPEN
        assert "NEP Studio is open" in said
        windows.run(windows.folder / "uninstall.exe", "/S")
    assert (windows.folder / "_internal/a.dll").read_text("utf-8") == "_internal/a.dll 1.2.3"
    assert windows.registry(UNINSTALL, "DisplayVersion") == "1.2.3"


def test_failed_update_keeps_the_old_version_intact(windows: Windows) -> None:
    before = {path.name: path.read_bytes() for path in windows.folder.glob("*.*")}
    last = windows.folder / "uninstall.exe"  # moved last, after the other files
    if subprocess.run(["chattr", "+i", last], check=False).returncode != 0:
        pytest.skip("only root can hold a file at its place, and not on every disk")
    try:
        code, said = windows.run(windows.setups["1.3.0"], "/S")
    finally:
        subprocess.run(["chattr", "-i", last], check=True)
    assert code == IMPOSSIBLE
    assert "can't be replaced because another program uses them" in said
    assert {path.name: path.read_bytes() for path in windows.folder.glob("*.*")} == before
    assert (windows.folder / "_internal/a.dll").read_text("utf-8") == "_internal/a.dll 1.2.3"
    assert not (windows.folder / "new~").exists()
    assert windows.registry(UNINSTALL, "DisplayVersion") == "1.2.3"


def test_update_succeeds_after_an_interrupted_update(windows: Windows) -> None:
    (windows.folder / "old~").mkdir()
    (windows.folder / "new~").mkdir()
    for name in ("_internal", "nep.exe"):  # simulates a power failure during these moves
        (windows.folder / name).rename(windows.folder / "old~" / name)
    assert windows.run(windows.setups["1.3.0"], "/S") == (0, "")
    assert sorted(path.name for path in windows.folder.iterdir()) == [
        "_internal", "nep-studio.exe", "nep.exe", "uninstall.exe",
    ]  # fmt: skip
    assert (windows.folder / "_internal/a.dll").read_text("utf-8") == "_internal/a.dll 1.3.0"


def test_unwritable_install_folder_is_reported(computer: Windows) -> None:
    code, said = computer.run(computer.setups["1.2.3"], "/S", r"/D=Z:\proc\studio")
    assert code == IMPOSSIBLE
    assert r"Setup can't write to this folder: Z:\proc\studio" in said
    assert computer.registry(UNINSTALL, "DisplayVersion") == ""


def test_command_folder_is_added_to_a_long_path_and_removed_again(computer: Windows) -> None:
    computer.run(
        "reg", "add", r"HKCU\Environment", "/v", "Path", "/t", "REG_EXPAND_SZ", "/d", LONG_PATH, "/f"
    )
    assert computer.run(computer.setups["1.2.3"], "/S", "/PATH") == (0, "")
    assert computer.path().startswith(f"{LONG_PATH};C:\\users\\")
    assert computer.path().endswith(r"\AppData\Local\Programs\NEP Studio")
    assert computer.run(computer.setups["1.3.0"], "/S") == (0, "")
    assert computer.path().count("NEP Studio") == 1  # the update keeps the PATH entry without a duplicate
    computer.uninstall()
    assert computer.path() == LONG_PATH
