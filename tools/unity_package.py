"""Build the Unity package of the C# client: ``python -m tools.unity_package FOLDER``.

The package contains the library's sources. Unity ignores files of an installed package that have no
``.meta`` file, so a ``.meta`` file is generated for each. Its id is derived from the path of the file,
so that references to a script survive an update of the package.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import re
import sys
import tarfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
CSHARP = ROOT / "clients" / "csharp"
UNITY = CSHARP / "unity"
IMPORTERS = {
    ".asmdef": "AssemblyDefinitionImporter",
    ".cs": "MonoImporter",
    ".json": "PackageManifestImporter",
    ".md": "TextScriptImporter",
}
HIDDEN = ("Documentation~", "Samples~")
"""Folders that Unity does not import.

A user can copy the samples, with their ``.meta`` files, to a project.
"""


def package_files() -> dict[str, bytes]:
    """Return the content of each file by its path in the package."""
    sources = {
        "package.json": UNITY / "package.json",
        "LICENSE.md": ROOT / "LICENSE",
        "Runtime/Nep/Nep.asmdef": UNITY / "Nep.asmdef",
    }
    for source in (CSHARP / "src").rglob("*.cs"):
        sources[f"Runtime/Nep/{source.relative_to(CSHARP / 'src').as_posix()}"] = source
    for source in (UNITY / "Runtime").glob("*.*"):
        sources[f"Runtime/Unity/{source.name}"] = source
    for source in (UNITY / "Samples~").rglob("*.cs"):
        sources[source.relative_to(UNITY).as_posix()] = source
    readme = (CSHARP / "README.md").read_text("utf-8")
    for page in re.findall(r"\(\.\./\.\./docs/([\w-]+\.md)", readme):
        sources[f"Documentation~/{page}"] = ROOT / "docs" / page
    files = {path: source.read_bytes() for path, source in sources.items()}
    files["README.md"] = readme.replace("(../../docs/", "(Documentation~/").encode()
    return dict(sorted((files | _metas(files)).items()))


def _metas(files: dict[str, bytes]) -> dict[str, bytes]:
    visible_paths = [PurePosixPath(path) for path in files if not path.startswith("Documentation~/")]
    folders = {parent for path in visible_paths for parent in path.parents if parent.name}
    return {
        f"{path}.meta": _meta(path, is_folder=path in folders)
        for path in {*visible_paths, *folders}
        if path.name not in HIDDEN
    }


def _meta(path: PurePosixPath, *, is_folder: bool) -> bytes:
    guid = hashlib.md5(f"org.nep.unity/{path}".encode(), usedforsecurity=False).hexdigest()
    importer = "folderAsset: yes\nDefaultImporter:" if is_folder else f"{IMPORTERS[path.suffix]}:"
    settings = "externalObjects: {}\n  userData: \n  assetBundleName: \n  assetBundleVariant: \n"
    return f"fileFormatVersion: 2\nguid: {guid}\n{importer}\n  {settings}".encode()


def build(folder: Path) -> Path:
    """Write the package as a tarball into a folder and return its path. Builds are reproducible."""
    version = json.loads((UNITY / "package.json").read_text("utf-8"))["version"]
    target = folder / f"org.nep.unity-{version}.tgz"
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for path, content in package_files().items():
            entry = tarfile.TarInfo(f"package/{path}")
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    folder.mkdir(parents=True, exist_ok=True)
    target.write_bytes(gzip.compress(packed.getvalue(), mtime=0))
    return target


def main() -> int:
    """Build the package into the folder given on the command line; return 0, or 2 without a folder."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    print(build(Path(sys.argv[1])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
