"""Block editor's web page as a widget, and the messages between window and page.

`view` is the widget, `bridge` the calls in both directions; the page itself is `app/blocks/editor/`.
"""
