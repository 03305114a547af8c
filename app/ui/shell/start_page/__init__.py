"""The start page: its cards, pictures and previews."""
