"""Sheets and dialogs over the window: palette, settings, shortcuts and questions.

They aren't modal: each is an `Overlay`, or leaves Stop accessible in another way.
"""
