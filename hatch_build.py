"""Build hook that compiles the translations, also for editable installs.

Programs only read .mo files; the sources are nep/locale/*/*.po.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg]  # hatchling doesn't specify it
    """Hook that hatchling runs before each build."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002 - signature of hatchling
        """Compile all message catalogues."""
        sys.path.insert(0, str(Path(__file__).resolve().parent))
        from tools.words import compile_all  # noqa: PLC0415 - Babel is installed only for builds

        compile_all()
