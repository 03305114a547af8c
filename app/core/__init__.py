"""What the window shows and does, without the window: session, mailbox, runner. No Qt.

`app.core.session.Session` joins its rooms; threads hand over to it by `app.core.network.mailbox` alone.
"""
