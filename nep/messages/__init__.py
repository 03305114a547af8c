"""Messages and what is in them: codecs between bytes and payloads, pictures, queues of messages.

Nothing here knows of sockets, nodes or masters.
"""
