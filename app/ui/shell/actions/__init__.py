"""Commands, their QActions and their keyboard shortcuts.

Independent of the window; the commands are implemented in `app.ui.shell.commands`.
"""
