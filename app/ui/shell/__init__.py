"""Main window around the panels; `main_window` combines bars, layouts, dialogs and commands.

The other modules don't import the window: commands use the interface `Shell`, panels use
`PanelContext`.
"""
