"""Steps of starting Studio: interpreter settings, single instance, files to open, Qt's log.

`app.ui.application` calls them; they are independent of each other.
"""
