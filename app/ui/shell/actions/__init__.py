"""What a command is, its QAction, and its keys as a person changed them.

It knows no window: `app.ui.shell.commands` is what the commands do.
"""
