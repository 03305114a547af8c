"""Start page with its cards, images and previews of behaviours.

`StartPage` emits signals for a person's choices.
"""
