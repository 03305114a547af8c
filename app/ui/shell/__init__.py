"""Window around the panels; `main_window` combines bars, layouts, dialogs and commands.

The parts don't import the window: commands use it as a `Shell`, panels as a `PanelContext`.
"""
