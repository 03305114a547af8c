"""Pin the packages with their hashes in requirements/*.txt.

    python tools/lock.py            add new requirements of pyproject.toml and keep existing pins
    python tools/lock.py --upgrade  pin the newest versions that pyproject.toml allows

Uses uv (`pip install uv`), which, unlike pip, resolves for all systems and Python versions at once. dev.py
installs the files with the uv of requirements/installer.txt, or with pip if that fails.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).resolve().parents[1]
OLDEST_PYTHON = "3.10"
PLAIN = "library"
"""Name of the file with the requirements of nep without extras."""
LOCKED = ("studio", "dev", "test", "fuzz", "package", PLAIN)
"""Names of the files in order; each is constrained by the previous ones. All but the last name an extra."""
INSTALLER = "installer"
"""Name of the file that pins uv, which installs the other files and has no dependencies."""
EDITABLE = ("editables",)
"""Build requirements of editable installs with hatchling, which pyproject.toml doesn't declare."""


def compile_command(uv: str, extra: str, output: Path, upgrade: bool) -> list[str]:
    """Return the uv command that writes one file of pins; it expects build requirements on stdin.

    Args:
        uv: Path of uv.
        extra: Extra of pyproject.toml, `PLAIN` or `INSTALLER`.
        output: File to write.
        upgrade: True to pin the newest versions; otherwise existing pins are retained.
    """
    arguments = [uv, "pip", "compile", "--quiet", "--universal", "--python-version", OLDEST_PYTHON]
    arguments += ["--generate-hashes", "--no-annotate", "--no-header", "--no-emit-package", "nep-studio"]
    arguments += ["--output-file", str(output)]
    if extra == INSTALLER:
        return [*arguments, *(["--upgrade"] if upgrade else []), "-"]
    if extra != PLAIN:
        arguments += ["--extra", extra]
    arguments += [f"--constraint={output.with_name(f'{each}.txt')}" for each in LOCKED[: LOCKED.index(extra)]]
    if upgrade:
        arguments.append("--upgrade")
    return [*arguments, "pyproject.toml", "-"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Write all files; return 0, 2 if uv is missing, or the exit code of uv if it fails."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--upgrade", action="store_true", help="pin the newest allowed versions")
    options = parser.parse_args(arguments)
    uv = shutil.which("uv")
    if uv is None:
        print("lock: uv is missing; install it with 'pip install uv'", file=sys.stderr)
        return 2
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    builds = "\n".join((*project["build-system"]["requires"], *EDITABLE))
    for extra in (*LOCKED, INSTALLER):
        output = ROOT / "requirements" / f"{extra}.txt"
        output.parent.mkdir(exist_ok=True)
        requirements = "uv>=0.9" if extra == INSTALLER else builds
        completed = subprocess.run(
            compile_command(uv, extra, output, options.upgrade),
            cwd=ROOT,
            input=requirements,
            text=True,
            check=False,
        )
        if completed.returncode != 0:
            return completed.returncode
    return 0


if __name__ == "__main__":
    sys.exit(main())
