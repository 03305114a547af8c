"""Operating system services: addresses, descriptors, forks, terminals, streams, plug-ins, lazy imports.

Independent of messages.
"""
