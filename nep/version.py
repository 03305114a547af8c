"""The version of NEP Studio and of nep: one place for packages, checkouts and frozen programs."""

from __future__ import annotations

__all__ = ["RELEASES_PAGE", "__version__"]

__version__ = "0.1.0"

RELEASES_PAGE = ""
"""The page of the project's releases, "https://..."; while there is none, Studio has no entry for it."""
