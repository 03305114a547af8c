"""The start page: its cards, pictures and previews of behaviours.

`StartPage` tells by signals what a person chose.
"""
