"""Docks of a layout: their frames, positions and sizes.

`Workbench` shows one layout; `saved_layouts` saves the user's changes for the next start.
"""
