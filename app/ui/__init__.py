"""Widgets and the web view: the only package that imports PySide6."""

from app.ui import overrides

overrides.guard_all()  # before any class of ours is made
