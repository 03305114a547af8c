"""Recordings panel: files of the recordings folder, with details and export.

`columns` contains the columns of the table, `table` handles opening, renaming and deleting, and
`details` contains the actions on the selected recording.
"""

from app.ui.panels.record.recordings.panel import PANEL as PANEL
