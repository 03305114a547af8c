"""State and logic of the window, independent of Qt.

`app.core.session.Session` owns all parts; background threads pass data to it only through
`app.core.network.mailbox`.
"""
