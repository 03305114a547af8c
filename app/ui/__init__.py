"""Graphical user interface; the only package that imports PySide6.

`application` is the entry point. Imports go from the shell to the panels, to code shared by panels, to
the widgets and to the theme, never in the other direction.
"""

from app.ui import overrides

overrides.guard_all()  # must precede the definition of any Qt subclass
