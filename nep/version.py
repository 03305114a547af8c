"""The version of NEP Studio and of nep: one place for packages, checkouts and frozen programs."""

from __future__ import annotations

__all__ = ["__version__"]

__version__ = "0.1.0"
