"""Checks of an application bundle by the rules of macOS, codesign and notarisation."""

from __future__ import annotations

import os
import plistlib
from collections.abc import Iterator, Mapping
from pathlib import Path

from installers.macos.information import LANGUAGES, OLDEST_MACOS, information
from installers.macos.mach_o import read

__all__ = ["BUNDLES", "WEB_PROCESS", "binaries", "binaries_for_newer_macos", "check", "is_bundle"]

BUNDLES = frozenset({".app", ".framework", ".bundle", ".plugin", ".xpc"})
WEB_PROCESS = "QtWebEngineProcess.app"
_CONTENTS_ENTRIES = frozenset(
    {"Info.plist", "PkgInfo", "MacOS", "Frameworks", "Resources", "_CodeSignature", "CodeResources"}
)
_CODE_FOLDERS = ("MacOS", "Frameworks")
_SYSTEM_FOLDERS = ("/usr/lib/", "/System/")
_WEB_FILES = ("icudtl.dat", "qtwebengine_resources.pak", "qtwebengine_locales/en-US.pak")


def is_bundle(path: Path) -> bool:
    """Return True if a folder is a bundle, which is signed as a unit."""
    return path.suffix in BUNDLES and path.is_dir() and not path.is_symlink()


def binaries(folder: Path) -> Iterator[Path]:
    """Yield all binaries below a folder in sorted order, without following links."""
    return (path for path in _files(folder) if not path.is_symlink() and read(path))


def check(app: Path, version: str, machine: str) -> list[str]:
    """Check an application bundle and return a sentence for each problem.

    Args:
        app: The bundle.
        version: Expected version.
        machine: Processor that all binaries must support, "arm64" or "x86_64".

    Raises:
        OSError: A file can't be read.
    """
    contents = app / "Contents"
    problems = [f"{name} is next to Contents" for name in _names(app) if name != "Contents"]
    problems += [
        f"{name} is not allowed in Contents" for name in _names(contents) if name not in _CONTENTS_ENTRIES
    ]
    problems += _check_information(contents, version, machine)
    problems += _check_links(app)
    problems += _check_places(contents)
    for framework in sorted(contents.rglob("*.framework")):
        if is_bundle(framework):
            problems += _check_framework(framework, app)
    problems += _check_web(contents)
    problems += _check_linked_libraries(contents)
    for path in binaries(contents):
        machines = {each.machine for each in read(path)}
        if machine not in machines:
            problems.append(
                f"{_relative_path(path, app)} is built for {' and '.join(sorted(machines))}, not {machine}"
            )
    return problems


def binaries_for_newer_macos(app: Path, machine: str) -> dict[Path, str]:
    """Return the binaries built for a newer macOS than the application requires, with the version of each.

    The older macOS loads such a binary, which fails only when it calls a missing function. Therefore
    these binaries must be tested on the oldest supported macOS.
    """
    oldest = tuple(int(each) for each in OLDEST_MACOS[machine].split("."))
    min_versions = {
        path: max(
            (each.oldest_macos or (0, 0) for each in read(path) if each.machine == machine), default=(0, 0)
        )
        for path in binaries(app / "Contents")
    }
    return {path: f"{wants[0]}.{wants[1]}" for path, wants in min_versions.items() if wants > oldest}


def _files(folder: Path) -> Iterator[Path]:
    for root, folders, names in os.walk(folder):
        folders.sort()
        yield from (Path(root, name) for name in sorted(names))


def _names(folder: Path) -> list[str]:
    return sorted(each.name for each in folder.iterdir()) if folder.is_dir() else []


def _relative_path(path: Path, app: Path) -> str:
    return str(path.relative_to(app))


def _check_information(contents: Path, version: str, machine: str) -> Iterator[str]:
    try:
        info = plistlib.loads((contents / "Info.plist").read_bytes())
    except (OSError, ValueError, plistlib.InvalidFileException) as error:
        yield f"Contents/Info.plist can't be read: {error}"
        return
    for key, value in information(version, machine).items():
        if info.get(key) != value:
            yield f"Contents/Info.plist has {info.get(key)!r} for {key}, not {value!r}"
    program = contents / "MacOS" / str(info.get("CFBundleExecutable", ""))
    if not program.is_file() or not any(each.is_program for each in read(program)):
        yield f"Contents/MacOS has no program '{program.name}'"
    elif not os.access(program, os.X_OK):
        yield f"Contents/MacOS/{program.name} is not executable"
    yield from _check_resources(contents / "Resources", info)


def _check_resources(resources: Path, info: Mapping[str, object]) -> Iterator[str]:
    documents = info.get("CFBundleDocumentTypes")
    icons = [info.get("CFBundleIconFile")]
    icons += [each.get("CFBundleTypeIconFile") for each in documents] if isinstance(documents, list) else []
    for icon in icons:
        path = resources / str(icon)
        header = path.read_bytes()[:8] if path.is_file() else b""
        if header[:4] != b"icns" or int.from_bytes(header[4:], "big") != path.stat().st_size:
            yield f"Contents/Resources has no icon '{icon}'"
    for language in LANGUAGES:
        if not (resources / f"{language}.lproj" / "InfoPlist.strings").is_file():
            yield f"Contents/Resources has no texts for '{language}'"


def _check_links(app: Path) -> Iterator[str]:
    root = app.resolve()
    for folder, folders, names in os.walk(app):
        for path in (Path(folder, name) for name in sorted([*folders, *names])):
            if not path.is_symlink():
                continue
            target = path.readlink()
            if target.is_absolute():
                yield f"{_relative_path(path, app)} is a link to the absolute path '{target}'"
            elif not path.resolve().is_relative_to(root):
                yield f"{_relative_path(path, app)} is a link out of the application"
            elif not path.exists():
                yield f"{_relative_path(path, app)} is a broken link"


def _check_places(contents: Path) -> Iterator[str]:
    # Only code belongs into MacOS and Frameworks, whose subfolders must have no dots.
    app = contents.parent
    for path in binaries(contents / "Resources"):
        yield f"{_relative_path(path, app)} is code in Resources, which codesign does not sign"
    for name in _CODE_FOLDERS:
        for folder, folders, names in os.walk(contents / name):
            subfolders = [Path(folder, each) for each in folders]
            folders[:] = sorted(path.name for path in subfolders if not is_bundle(path))
            for path in subfolders:
                if "." in path.name and not path.is_symlink() and not is_bundle(path):
                    yield (
                        f"{_relative_path(path, app)} has a dot in its name, so codesign treats it as "
                        "a bundle"
                    )
            for path in (Path(folder, each) for each in sorted(names)):
                if not path.is_symlink() and not read(path):
                    yield (
                        f"{_relative_path(path, app)} is not code, so its signature would be lost when it "
                        "is copied"
                    )


def _check_linked_libraries(contents: Path) -> Iterator[str]:
    # Linked libraries must be in the application or part of macOS.
    file_names = {path.name for path in _files(contents)}
    for path in binaries(contents):
        for name in dict.fromkeys(name for each in read(path) for name in each.needs):
            if name.startswith("/"):
                is_available = name.startswith(_SYSTEM_FOLDERS)
            else:
                is_available = name.rpartition("/")[2] in file_names
            if not is_available:
                yield f"{_relative_path(path, contents.parent)} is linked with '{name}', which is missing"


def _check_framework(framework: Path, app: Path) -> Iterator[str]:
    name = framework.stem
    for path in sorted(framework.iterdir()):
        if path.name != "Versions" and not path.is_symlink():
            yield f"{_relative_path(path, app)} is next to Versions and not a link into it"
    current = framework / "Versions" / "Current"
    if not current.is_symlink():
        yield f"{_relative_path(framework, app)} has no link Versions/Current"
    elif not (current / name).is_file() or not read(current / name):
        yield f"{_relative_path(framework, app)} has no library '{name}'"
    elif not (current / "Resources" / "Info.plist").is_file():
        yield f"{_relative_path(framework, app)} has no Resources/Info.plist"


def _check_web(contents: Path) -> Iterator[str]:
    # Files of Qt WebEngine in the places where Qt expects them.
    frameworks = [path for path in contents.rglob("QtWebEngineCore.framework") if is_bundle(path)]
    if len(frameworks) != 1:
        yield f"there are {len(frameworks)} QtWebEngineCore.framework, not 1"
        return
    process = frameworks[0] / "Helpers" / WEB_PROCESS / "Contents" / "MacOS" / "QtWebEngineProcess"
    if not process.is_file() or not read(process):
        yield f"{_relative_path(frameworks[0], contents.parent)} has no Helpers/{WEB_PROCESS}"
    elif not os.access(process, os.X_OK):
        yield f"{_relative_path(process, contents.parent)} is not executable"
    for name in _WEB_FILES:
        if not (frameworks[0] / "Resources" / name).is_file():
            yield f"{_relative_path(frameworks[0], contents.parent)} has no Resources/{name}"
