"""What is in messages: pictures and large JSON, decoded beside the window, only as far as somebody looks.

The codecs are in `nep.messages`; here is what a window needs that must not wait for them.
"""
