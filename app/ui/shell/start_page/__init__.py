"""Start page with its cards, images and previews of behaviours.

`StartPage` emits signals for the user's choices.
"""
