"""The window around the panels: `main_window` puts together bars, layouts, dialogs and commands.

Its parts do not know it: commands know it as a `Shell`, panels as a `PanelContext`.
"""
