"""Version of NEP Studio and nep, used by packages, checkouts and frozen programs."""

from __future__ import annotations

__version__ = "0.1.0"

RELEASES_PAGE = ""
"""URL of the project's releases page. While it is empty, Studio shows no link."""
