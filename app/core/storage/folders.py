"""Folders of Studio's files."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from nep.i18n import _


def home() -> Path:
    """Return Studio's folder: ``$NEP_STUDIO_HOME``, else the system's configuration folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return (
        Path(configured) if configured else Path(platformdirs.user_config_dir("nep-studio", appauthor=False))
    )


def data_home() -> Path:
    """Return the folder for large data: ``$NEP_STUDIO_HOME``, else the system's data folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return Path(configured) if configured else Path(platformdirs.user_data_dir("nep-studio", appauthor=False))


def state_home() -> Path:
    """Return the folder for runtime state: ``$NEP_STUDIO_HOME``, else the system's state folder."""
    configured = os.environ.get("NEP_STUDIO_HOME")
    return (
        Path(configured) if configured else Path(platformdirs.user_state_dir("nep-studio", appauthor=False))
    )


def closed_tabs_folder() -> Path:
    """Return the folder for behaviours whose tabs were closed before they were saved to a file."""
    return home() / "kept"


def default_pictures_folder() -> Path:
    """Return the default folder for snapshots.

    This is ``NEP Studio`` in the system's picture folder, or ``Pictures`` in ``$NEP_STUDIO_HOME`` if that is
    set.
    """
    if os.environ.get("NEP_STUDIO_HOME"):
        return home() / "Pictures"
    return platformdirs.user_pictures_path() / "NEP Studio"


def default_recordings_folder() -> Path:
    """Return the default folder of recordings.

    This is ``Recordings`` (translated) in the documents folder of the user, or in ``$NEP_STUDIO_HOME``
    if that is set.
    """
    configured = os.environ.get("NEP_STUDIO_HOME")
    return Path(configured or platformdirs.user_documents_dir()) / _("Recordings")
