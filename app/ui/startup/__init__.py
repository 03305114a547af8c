"""What happens once when Studio starts: the interpreter's settings, one window, files to open, Qt's log.

`app.ui.application` calls each of them; none knows another.
"""
