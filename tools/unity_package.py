"""Build the Unity package of the C# client: ``python -m tools.unity_package FOLDER``.

The package contains the library's sources. Unity ignores files of an installed package without a ``.meta``
file, so one is generated for each, with an id derived from the file's path.
"""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import sys
import tarfile
from pathlib import Path, PurePosixPath

ROOT = Path(__file__).parents[1]
CSHARP = ROOT / "clients" / "csharp"
UNITY = CSHARP / "unity"


def package_files() -> dict[str, bytes]:
    """Return the content of each file by its path in the package."""
    placed = {
        "package.json": UNITY / "package.json",
        "README.md": CSHARP / "README.md",
        "LICENSE.md": ROOT / "LICENSE",
        "Runtime/Nep/Nep.asmdef": UNITY / "Nep.asmdef",
    }
    for source in (CSHARP / "src").rglob("*.cs"):
        placed[f"Runtime/Nep/{source.relative_to(CSHARP / 'src').as_posix()}"] = source
    for source in (UNITY / "Runtime").iterdir():
        placed[f"Runtime/Unity/{source.name}"] = source
    for source in (UNITY / "Samples~").rglob("*.cs"):
        placed[source.relative_to(UNITY).as_posix()] = source
    files = {path: source.read_bytes() for path, source in sorted(placed.items())}
    return dict(sorted((files | _metas(files)).items()))


def _metas(files: dict[str, bytes]) -> dict[str, bytes]:
    shown = [PurePosixPath(path) for path in files if not path.startswith("Samples~/")]
    folders = {parent for path in shown for parent in path.parents if parent.name}
    return {f"{path}.meta": _meta(path, is_folder=path in folders) for path in {*shown, *folders}}


def _meta(path: PurePosixPath, *, is_folder: bool) -> bytes:
    guid = hashlib.md5(f"org.nep.unity/{path}".encode(), usedforsecurity=False).hexdigest()
    folder = "folderAsset: yes\n" if is_folder else ""
    return f"fileFormatVersion: 2\nguid: {guid}\n{folder}".encode()


def build(folder: Path) -> Path:
    """Write the tarball into a folder and return its path. The same sources give the same bytes."""
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
    """Build into the folder given on the command line."""
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 2
    print(build(Path(sys.argv[1])))
    return 0


if __name__ == "__main__":
    sys.exit(main())
