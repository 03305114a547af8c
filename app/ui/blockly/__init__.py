"""Widget with the web page of the block editor, and the messages between window and page.

`view` contains the widget, `bridge` the channel, `messages` the messages in both directions; the page itself
is `app/blocks/editor/`.
"""
