"""Parts of Studio's startup.

These are interpreter settings, deferred steps, single instance, files to open, file dialogs of the desktop,
software rendering, the browser's sandbox, and Qt's log. `app.ui.application` calls the modules.
"""
