"""Commands, their QActions and their configurable keyboard shortcuts.

Independent of the window; `app.ui.shell.commands` implements the commands.
"""
