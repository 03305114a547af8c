"""Content of messages: images and large JSON. Only visible parts are decoded, in the background.

The codecs are in `nep.messages`.
"""
