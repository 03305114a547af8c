"""Recordings panel: files of the recordings folder, with details and export.

`columns` renders the rows, `table` handles opening, renaming and deleting, `details` has the actions on the
selected recording.
"""

from app.ui.panels.recordings.panel import PANEL as PANEL
