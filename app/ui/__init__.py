"""Widgets and the web view: the only package that imports PySide6."""
