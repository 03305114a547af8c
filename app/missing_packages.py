"""Why Studio could not be imported, in a sentence: a package or a system library that is not installed.

Imports nothing that is not there without the extra ``studio``.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable

from app.core.system_libraries import missing_libraries, named_in
from nep.i18n import _, listed

__all__ = ["EXTRA_MODULES", "why_not_imported"]

EXTRA_MODULES = (
    "PySide6",
    "cv2",
    "graphlay",
    "jsonpath",
    "jsonschema",
    "mcap",
    "numpy",
    "platformdirs",
    "pyqtgraph",
)
"""Modules of the extra ``studio`` in pyproject.toml without which there is no window."""


def why_not_imported(
    error: ImportError,
    is_installed: Callable[[str], bool] = lambda name: bool(importlib.util.find_spec(name)),
) -> str:
    """Return what is missing and how to install it; "" when the error is about something else."""
    package = (error.name or "").partition(".")[0]
    if isinstance(error, ModuleNotFoundError) and package in EXTRA_MODULES:
        missing = [each for each in EXTRA_MODULES if each == package or not is_installed(each)]
        return _(
            "NEP Studio needs packages that are not installed ({names}); install them with “{command}”"
        ).format(names=listed(missing), command="pip install 'nep-studio[studio]'")
    libraries = missing_libraries() if named_in(str(error)) else None
    return f"{libraries.start_title} {libraries.start_remedy}" if libraries is not None else ""
