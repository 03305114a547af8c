"""Messages: codecs between payloads and bytes, images and queues.

Independent of sockets, nodes and masters.
"""
