"""Detection of packages named `nep` and `nep-js`, of NEP Studio or of the original NEP.

On the public registries these names belong to the original NEP. The packages found are not imported.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from nep.programs.doctor.facts import PackageFact

_SITE_PACKAGES = (
    "lib/{}/site-packages",
    "lib/{}/dist-packages",
    "local/lib/{}/dist-packages",
    "Lib/site-packages",
)
_FIRST_NATIVE_VERSION = (0, 6)


def node_packages(program_folder: Path, environ: Mapping[str, str] = os.environ) -> tuple[PackageFact, ...]:
    """Return all packages `nep-js` on Node.js's search path; the first one is imported.

    Args:
        program_folder: Folder of the JavaScript program.
        environ: Environment variables.
    """
    folder = program_folder.absolute()
    module_folders = [
        each / "node_modules" for each in (folder, *folder.parents) if each.name != "node_modules"
    ]
    extra_folders = [Path(each) for each in environ.get("NODE_PATH", "").split(os.pathsep) if each]
    packages = (_node_package(each / "nep-js") for each in dict.fromkeys((*module_folders, *extra_folders)))
    return tuple(each for each in packages if each is not None)


def _node_package(folder: Path) -> PackageFact | None:
    try:
        manifest = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return None
    if not isinstance(manifest, dict):
        return None
    is_ours = isinstance(manifest.get("nep"), dict)  # as in clients/javascript/package.json
    return PackageFact("nep-js", str(manifest.get("version", "")), str(folder), is_ours)


def path_python_package(
    path: str | None = None, own_environment: Path = Path(sys.prefix), home: Path | None = None
) -> PackageFact | None:
    """Return the original package `nep` that `python3` on the PATH imports, or None.

    The environment of this program is not searched, because it is checked separately.

    Args:
        path: Search path (default: PATH).
        own_environment: Environment of this program.
        home: Home folder with the user's packages (default: the user's).
    """
    python = shutil.which("python3", path=path) or shutil.which("python", path=path)
    if python is None:
        return None
    environment = Path(python).parent.resolve().parent
    if environment == own_environment.resolve():
        return None
    name = Path(python).resolve().name
    folder_names = (name, "python3") if name.startswith("python3.") else ("python3*",)
    is_virtual = (environment / "pyvenv.cfg").exists()
    user_folders = [] if is_virtual else [(home or Path.home()) / ".local"]
    return next(_original_packages((*user_folders, environment), folder_names), None)


def _original_packages(environments: Iterable[Path], names: Iterable[str]) -> Iterator[PackageFact]:
    patterns = dict.fromkeys(site.format(name) for name in names for site in _SITE_PACKAGES)
    for environment in environments:
        for site in (site for pattern in patterns for site in sorted(environment.glob(pattern))):
            package = site / "nep"
            if not package.is_dir() or (package / "protocol").is_dir():  # the original has no such folder
                continue
            for info in (*site.glob("nep-*.dist-info"), *site.glob("nep-*.egg-info")):
                version = info.name.removeprefix("nep-").partition("-py")[0].removesuffix(info.suffix)
                if _version_numbers(version) < _FIRST_NATIVE_VERSION:
                    yield PackageFact("nep", version, str(site), is_ours=False)


def _version_numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdecimal())
