"""The docks of a layout: their frames, places and sizes.

`Workbench` is one layout; `saved_layouts` keeps what a person made of it for the next start.
"""
