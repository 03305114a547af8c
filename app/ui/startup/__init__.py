"""Parts of Studio's startup: interpreter settings, single instance, files to open, and Qt's log.

The modules are independent of each other; `app.ui.application` calls them.
"""
