"""State and logic of the window without Qt: session, mailbox, runner.

`app.core.session.Session` connects its parts; threads pass data to it only through
`app.core.network.mailbox`.
"""
