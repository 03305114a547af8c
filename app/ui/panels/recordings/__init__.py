"""Recordings: the files of the folder, with what is in each.

`columns` says how one is shown, `table` lets a person open, rename and delete them, `details` has what can be
done with the chosen one.
"""

from app.ui.panels.recordings.panel import PANEL as PANEL
