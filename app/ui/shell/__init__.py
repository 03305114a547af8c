"""The window around the panels; `main_window` combines bars, layouts, dialogs and commands.

Its parts don't import it: commands use it as a `Shell`, panels as a `PanelContext`.
"""
