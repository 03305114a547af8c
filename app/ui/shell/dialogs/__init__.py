"""Sheets over the window: palette, settings, shortcuts, file dialogs and questions.

No sheet is modal: each is an `Overlay`, or leaves Stop accessible in another way.
"""
