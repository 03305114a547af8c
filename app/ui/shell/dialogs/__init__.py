"""What opens over the window: palette, settings, shortcuts and questions.

Nothing here is modal: each is an `Overlay`, or leaves Stop free as one does.
"""
