"""Messages: codecs between payloads and bytes, images, queues.

Independent of sockets, nodes and masters.
"""
