"""Content of messages: images, large JSON, queries and annotations.

Large messages are decoded in the background, and only where a part is visible. The codecs are in
`nep.messages`.
"""
