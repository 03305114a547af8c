"""Graphical user interface; the only package that imports PySide6.

`application` starts it. Layers import downward: shell, panels, code shared by panels, widgets, theme.
"""

from app.ui import overrides

overrides.guard_all()  # must precede the definition of any Qt subclass
