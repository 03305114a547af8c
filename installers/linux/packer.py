"""Packages for Linux: `nep-studio_VERSION_ARCH.deb` and `NEP-Studio-VERSION-linux-ARCH.tar.xz`.

Both contain the same folder: the two programs and their libraries, `share` with the desktop files,
`install.sh` for the unpacked archive, licences and notice. If `appimagetool` is installed, an AppImage is
built, too.
"""

from __future__ import annotations

import gzip
import os
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from installers.context import APP, ROOT, Context, PackageError
from installers.freeze import add_licences, freeze
from installers.icon_files import ICON_SIZES, paint_icons
from installers.linux.film_libraries import remove_ffmpeg
from installers.linux.system_libraries import libc_needed, system_packages

HERE = Path(__file__).resolve().parent
NAME = "nep-studio"
PREFIX = Path("opt") / NAME
ARCHITECTURES = {"x86_64": "amd64", "arm64": "arm64"}
RECOMMENDED = ("fonts-noto-color-emoji", "xdg-desktop-portal")
"""Recommended packages, for emoji and for the desktop's file dialogs."""
DESCRIPTION = """watch the messages of robots and program their behaviour
 NEP Studio shows the live messages of robots and programs, records them, and
 has a block editor for robot behaviours, which run on a virtual robot and on
 real robots.
"""


WITH_DEBUG_INFO = ("lz4", "msgpack", "zstandard")
"""Packages whose Linux wheels contain mostly debug information (zstandard: 10 of 11 MB)."""


def build(context: Context, *, keep_frozen: bool) -> Sequence[Path]:
    """Build the packages and the bill of materials, and return their paths.

    Args:
        context: Version and folders.
        keep_frozen: True to reuse the frozen program of an earlier build.

    Raises:
        PackageError: A tool is missing or a step has failed.
    """
    if not (keep_frozen and context.frozen.is_dir()):
        freeze(context)
        strip(context)
        remove_ffmpeg(context)
    bill = add_licences(context, context.frozen, context.frozen)
    add_share(context, context.frozen)
    packages = [debian_package(context), archive(context), bill]
    tool = shutil.which("appimagetool")
    if tool is None:
        print("· the AppImage is skipped: appimagetool is not installed", flush=True)
        return packages
    return [*packages, app_image(context, tool)]


def strip(context: Context) -> None:
    """Remove debug information from Python's own libraries and from the packages in `WITH_DEBUG_INFO`.

    Debug information is up to two thirds of their size. Other libraries are stripped already, and
    stripping again damages some of them. Has no effect if the program `strip` isn't installed.
    """
    tool = shutil.which("strip")
    internal = context.frozen / "_internal"
    if tool is None:
        return
    pythons = (*internal.glob("libpython3*.so*"), *internal.glob("python3*/lib-dynload/*.so"))
    packages = (path for name in WITH_DEBUG_INFO for path in (internal / name).rglob("*.so"))
    for path in (*pythons, *packages):
        if not path.is_symlink():
            context.run(tool, "--strip-unneeded", path)


def add_share(context: Context, folder: Path) -> None:
    """Add desktop files: menu entry, file type, icons, and the script that installs them."""
    share = folder / "share"
    shutil.rmtree(share, ignore_errors=True)
    for source, target in (
        ("nep-studio.desktop", "applications/nep-studio.desktop"),
        ("nep-studio-mime.xml", "mime/packages/nep-studio.xml"),
        ("apparmor-profile", "apparmor-profile"),
    ):
        (share / target).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(HERE / source, share / target)
    painted = paint_icons(context)
    for size in ICON_SIZES:
        for name, kind, target in (
            ("nep-studio", "apps", "nep-studio"),
            ("nep-behaviour", "mimetypes", "application-x-nep-behaviour"),
        ):
            icon_path = share / "icons" / "hicolor" / f"{size}x{size}" / kind / f"{target}.png"
            icon_path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(painted / f"{name}-{size}.png", icon_path)
    shutil.copyfile(HERE / "install.sh", folder / "install.sh")
    (folder / "install.sh").chmod(0o755)


def archive(context: Context) -> Path:
    """Build the .tar.xz and return its path.

    Sorted names and a common time and owner make the archive reproducible.
    """
    target = context.dist / f"NEP-Studio-{context.version}-linux-{context.machine}.tar.xz"
    top = f"NEP-Studio-{context.version}"
    target.unlink(missing_ok=True)
    context.run(
        "tar", "--create", "--sort=name", f"--mtime=@{context.epoch}", "--owner=0", "--group=0",
        "--numeric-owner", "--mode=u+rwX,go+rX,go-w", f"--transform=flags=r;s|^{APP}|{top}|",
        "--use-compress-program=xz -6 -T2", f"--file={target}", f"--directory={context.frozen.parent}", APP,
    )  # fmt: skip
    return target


def debian_package(context: Context) -> Path:
    """Build the .deb for Debian and Ubuntu and return its path.

    Raises:
        PackageError: dpkg-deb isn't installed or has failed.
    """
    if shutil.which("dpkg-deb") is None:
        raise PackageError("dpkg-deb is not installed; the .deb can only be built on Debian and Ubuntu")
    root = context.work / "deb"
    shutil.rmtree(root, ignore_errors=True)
    program = root / PREFIX
    shutil.copytree(context.frozen, program, symlinks=True)
    for name in ("applications", "mime", "icons"):  # standard folders of all desktops
        shutil.move(program / "share" / name, root / "usr" / "share" / name)
    (program / "install.sh").unlink()
    (root / "usr" / "bin").mkdir(parents=True)
    (root / "usr" / "bin" / NAME).symlink_to(f"/{PREFIX}/{NAME}")
    _write_documents(context, root / "usr" / "share" / "doc" / NAME)
    _set_modes(root)
    control = root / "DEBIAN"
    control.mkdir()
    (control / "control").write_text(control_file(context, root, control), "utf-8")
    for name in ("postinst", "prerm"):
        shutil.copyfile(HERE / name, control / name)
        (control / name).chmod(0o755)
    (control / "md5sums").write_text("".join(_md5_sums(root, control)), "utf-8")
    _set_times(root, context.epoch)
    target = context.dist / f"{NAME}_{context.version}_{_architecture(context)}.deb"
    context.run("dpkg-deb", "--root-owner-group", "-Zxz", "-z6", "--threads-max=2", "--build", root, target)
    return target


def control_file(context: Context, root: Path, control: Path) -> str:
    """Return the content of the Debian control file.

    Args:
        context: Version and folders.
        root: Folder with the files to be installed.
        control: Folder of the control files.
    """
    files = [path for path in root.rglob("*") if path.is_file() and control not in path.parents]
    size = sum(path.lstat().st_size for path in files)
    packages, optional = system_packages(root / PREFIX)
    needed = [f"libc6 (>= {libc_needed(root)})", *map(_format_alternatives, packages)]
    recommended = [*map(_format_alternatives, optional), *RECOMMENDED]
    return (
        f"Package: {NAME}\nVersion: {context.version}\nArchitecture: {_architecture(context)}\n"
        "Maintainer: The NEP Studio authors <nep-studio@localhost>\nSection: science\nPriority: optional\n"
        f"Installed-Size: {size // 1024}\n"
        f"Depends: {', '.join(needed)}\n"
        f"Recommends: {', '.join(recommended)}\n"
        f"Description: {DESCRIPTION}"
    )


def _format_alternatives(entry: str) -> str:
    return " | ".join(entry.split("|"))


def _write_documents(context: Context, folder: Path) -> None:
    folder.mkdir(parents=True)
    shutil.copyfile(context.frozen / "NOTICE.txt", folder / "copyright")
    changes = (ROOT / "CHANGELOG.md").read_bytes()
    (folder / "changelog.gz").write_bytes(gzip.compress(changes, 9, mtime=context.epoch))


def _set_modes(root: Path) -> None:
    # Readable and executable for everybody, writable only for root.
    for path in [root, *root.rglob("*")]:
        if not path.is_symlink():
            is_executable = path.is_dir() or os.access(path, os.X_OK)
            path.chmod(0o755 if is_executable else 0o644)


def _set_times(root: Path, epoch: int) -> None:
    # dpkg-deb clamps newer timestamps but keeps older ones.
    for path in [root, *root.rglob("*")]:
        os.utime(path, (epoch, epoch), follow_symlinks=False)


def _md5_sums(root: Path, control: Path) -> Iterable[str]:
    files = [path for path in sorted(root.rglob("*")) if path.is_file() and not path.is_symlink()]
    names = [str(path.relative_to(root)) for path in files if control not in path.parents]
    completed = subprocess.run(["md5sum", "--", *names], cwd=root, capture_output=True, text=True, check=True)
    return [completed.stdout]


def _architecture(context: Context) -> str:
    return ARCHITECTURES.get(context.machine, context.machine)


def app_image(context: Context, tool: str) -> Path:
    """Build the AppImage and return its path.

    Args:
        context: Version and folders.
        tool: Path of `appimagetool`.
    """
    folder = context.work / "NEP-Studio.AppDir"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(context.frozen, folder, symlinks=True)
    (folder / "AppRun").symlink_to("nep-studio")
    shutil.copyfile(HERE / "nep-studio.desktop", folder / "nep-studio.desktop")
    shutil.copyfile(paint_icons(context) / "nep-studio-256.png", folder / "nep-studio.png")
    target = context.dist / f"NEP-Studio-{context.version}-linux-{context.machine}.AppImage"
    context.run(tool, "--no-appstream", folder, target)
    return target
