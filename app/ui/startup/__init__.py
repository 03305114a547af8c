"""Steps of Studio's startup: interpreter settings, single instance, files to open, Qt's log.

`app.ui.application` calls the steps; they are independent of each other.
"""
