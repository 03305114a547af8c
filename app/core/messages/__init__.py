"""Content of messages: images and large JSON, decoded in the background only as far as they are shown.

The codecs are in `nep.messages`.
"""
