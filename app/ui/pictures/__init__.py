"""Pictures of a stream: how they are shown, zoomed, and marked with what was recognised.

The panels Image and Camera share them; pictures are decoded by `app.core.messages`.
"""
