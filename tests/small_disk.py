"""Temporary file system of 256 kB for a test, which can become full or read-only."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TIMEOUT_S = 100


class SmallDisk:
    """Folder with a small file system mounted on it, visible only to the program started by `run`."""

    def __init__(self, folder: Path) -> None:
        """Skip the test on systems that do not permit mounting."""
        unshare = shutil.which("unshare")
        if unshare is None:
            pytest.skip("needs Linux with unshare")
        self.folder = folder
        self._unshare = [unshare, "-rm", "sh", "-c"]
        self._mount = f"mount -t tmpfs -o size=256k,mode=777 none '{folder}'"
        tried = subprocess.run([*self._unshare, self._mount], check=False, capture_output=True)
        if tried.returncode:
            pytest.skip("needs permission for user namespaces (unshare -rm)")

    def run(self, code: str, before: str = "true") -> dict[str, object]:
        """Run a Python program with the folder as its argument; return the object that it prints as JSON.

        ``before`` is a shell command that runs first, after the file system is mounted.
        """
        shell = f'{self._mount} && {before} && exec "$@"'
        done = subprocess.run(
            [*self._unshare, shell, "sh", sys.executable, "-c", code, str(self.folder)],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            capture_output=True,
            encoding="utf-8",
            timeout=TIMEOUT_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert isinstance(found, dict)
        return found
