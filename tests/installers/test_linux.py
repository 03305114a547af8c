"""Tests of the Linux packages, built by the real tools from a small fake of the frozen program."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
from dataclasses import replace
from pathlib import Path

import pytest

from installers.context import Context, PackageError
from installers.icon_files import ICON_SIZES
from installers.linux import packer
from installers.linux.system_libraries import libc_needed, system_packages
from installers.package import SUMS, write_sums
from nep.version import __version__

pytestmark = pytest.mark.skipif(
    not sys.platform.startswith("linux") or shutil.which("dpkg-deb") is None, reason="needs dpkg-deb"
)


@pytest.fixture
def context(tmp_path: Path) -> Context:
    """Packer context with shell scripts as the frozen program and generated icons."""
    made = replace(Context("linux"), root=tmp_path, epoch=1_700_000_000)
    made.dist.mkdir()
    inside = made.frozen / "_internal"
    inside.mkdir(parents=True)
    for name in ("nep-studio", "nep"):
        (made.frozen / name).write_text('#!/bin/sh\necho "$0 $*"\n', "utf-8")
        (made.frozen / name).chmod(0o755)
    shutil.copyfile("/bin/true", inside / "library.so")
    (inside / "link.so").symlink_to("library.so")
    (made.frozen / "NOTICE.txt").write_text("a notice", "utf-8")
    icons = made.work / "icons"
    icons.mkdir()
    for size in ICON_SIZES:
        for name in ("nep-studio", "nep-behaviour"):
            (icons / f"{name}-{size}.png").write_bytes(b"a picture")
    packer.add_share(made, made.frozen)
    return made


def test_debian_package_has_its_version_dependencies_and_files_owned_by_root(context: Context) -> None:
    made = packer.debian_package(context)
    fields = subprocess.run(["dpkg-deb", "--field", made], capture_output=True, text=True, check=True).stdout
    assert f"Version: {__version__}\n" in fields
    (needed,) = (line for line in fields.splitlines() if line.startswith("Depends: "))
    assert "xkb-data" in needed
    assert needed.startswith("Depends: libc6 (>= 2.")
    names = subprocess.run(
        ["dpkg-deb", "--contents", made], capture_output=True, text=True, check=True
    ).stdout
    for each in (
        "./opt/nep-studio/nep-studio\n",
        "./usr/bin/nep-studio -> /opt/nep-studio/nep-studio\n",
        "./usr/share/applications/nep-studio.desktop\n",
        "./usr/share/mime/packages/nep-studio.xml\n",
        "./usr/share/icons/hicolor/48x48/apps/nep-studio.png\n",
        "./usr/share/icons/hicolor/48x48/mimetypes/application-x-nep-behaviour.png\n",
        "./usr/share/doc/nep-studio/copyright\n",
        "./opt/nep-studio/_internal/link.so -> library.so\n",
    ):
        assert each in names, each
    assert "./usr/bin/nep\n" not in names, "the command is there when asked for"
    owners = {line.split()[1] for line in names.splitlines()}
    assert owners == {"root/root"}


def test_packages_are_reproducible(context: Context) -> None:
    sums = []
    for moment in (None, (1e9, 1e9), (2e9, 2e9)):  # unchanged, before and after the packages' time
        for path in context.frozen.rglob("*"):
            os.utime(path, moment, follow_symlinks=False)
        made = [packer.debian_package(context), packer.archive(context)]
        sums.append([hashlib.sha256(each.read_bytes()).hexdigest() for each in made])
    assert sums[0] == sums[1] == sums[2]


def test_checksum_file_is_accepted_by_sha256sum(context: Context) -> None:
    packer.archive(context)
    write_sums(context.dist)
    write_sums(context.dist)  # the checksum file must not list itself
    done = subprocess.run(["sha256sum", "--check", "--strict", SUMS], cwd=context.dist, check=False)
    assert done.returncode == 0


@pytest.fixture
def unpacked(context: Context, tmp_path: Path) -> Path:
    """Archive extracted to a folder whose name is hard to quote."""
    home = tmp_path / "Ana María 太郎 $(x) %u"
    home.mkdir()
    with tarfile.open(packer.archive(context)) as archive:
        archive.extractall(home, **({"filter": "tar"} if sys.version_info >= (3, 12) else {}))
    return home / f"NEP-Studio-{__version__}"


def run(script: Path, home: Path, *words: str) -> str:
    environ = {**os.environ, "HOME": str(home), "XDG_DATA_HOME": ""}
    done = subprocess.run([script, *words], env=environ, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_install_script_adds_a_menu_entry_and_removes_it_again(unpacked: Path, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    assert "in your menu" in run(unpacked / "install.sh", home, "--command")
    entry = (home / ".local/share/applications/nep-studio.desktop").read_text("utf-8")
    (command, *_others) = (line for line in entry.splitlines() if line.startswith("Exec="))
    quoted = str(unpacked / "nep-studio").replace("$", "\\\\$").replace("%", "%%")
    assert command == f'Exec="{quoted}" %F'
    assert entry.count("Exec=") == entry.count(f'Exec="{quoted}"'), "also of the actions"
    assert (home / ".local/share/icons/hicolor/48x48/apps/nep-studio.png").is_file()
    assert subprocess.run([home / ".local/bin/nep"], check=False).returncode == 0
    run(unpacked / "install.sh", home, "--remove")
    left = [path for path in home.rglob("*") if path.is_file() or path.is_symlink()]
    assert [path for path in left if "nep" in path.name] == []


def test_removal_keeps_a_foreign_nep_command(unpacked: Path, tmp_path: Path) -> None:
    command = tmp_path / "home" / ".local/bin/nep"
    command.parent.mkdir(parents=True)
    command.write_text("mine", "utf-8")
    run(unpacked / "install.sh", tmp_path / "home", "--remove")
    assert command.read_text("utf-8") == "mine"


def test_minimum_glibc_version_is_determined(context: Context) -> None:
    (context.frozen / "words.txt").write_text("GLIBC_9.99", "utf-8")  # not a library
    major, minor = map(int, libc_needed(context.frozen).split("."))
    assert (2, 2) <= (major, minor) < (2, 60)


def library(folder: Path, name: str, *needs: str) -> Path:
    """Build a library that is linked with others, for which stubs are built."""
    made = folder / name
    made.parent.mkdir(parents=True, exist_ok=True)
    stubs = folder.parent / "stubs"
    stubs.mkdir(exist_ok=True)
    link = ["gcc", "-shared", "-nostdlib", "-Wl,--no-as-needed", "-x", "c", "/dev/null"]
    for each in needs:
        subprocess.run([*link, f"-Wl,-soname,{each}", "-o", stubs / each], check=True)
    subprocess.run([*link, "-x", "none", *(stubs / each for each in needs), "-o", made], check=True)
    return made


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
def test_dependencies_cover_the_libraries_that_are_not_bundled(tmp_path: Path) -> None:
    folder = tmp_path / "frozen"
    library(folder, "a.so", "libasound.so.2", "libc.so.6", "libours.so.1")
    library(folder, "plugins/printsupport/b.so", "libcups.so.2", "libasound.so.2")
    (folder / "libours.so.1").touch()
    packages = (["libasound2t64|libasound2", "xkb-data"], ["libcups2t64|libcups2"])
    assert system_packages(folder) == packages
    library(folder, "c.so", "libstrange.so.3")
    with pytest.raises(PackageError, match=r"'c\.so' needs 'libstrange\.so\.3'"):
        system_packages(folder)
