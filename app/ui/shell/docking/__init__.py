"""Docks of a layout: frames, positions and sizes.

`Workbench` shows one layout; `saved_layouts` saves a person's changes for the next start.
"""
