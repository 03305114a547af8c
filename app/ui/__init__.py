"""Widgets and the web view: the only package that imports PySide6.

`application` starts it. Rooms import downward: shell, panels, what several panels use, widgets, theme.
"""

from app.ui import overrides

overrides.guard_all()  # before any class of ours is made
