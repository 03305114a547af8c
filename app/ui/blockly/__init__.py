"""The block editor's web page as a widget, and what window and page say to each other.

`view` is the widget, `bridge` the calls both ways; the page itself is `app/blocks/editor/`.
"""
