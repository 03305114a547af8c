"""What nep needs of the computer: addresses, open files, forks, terminals, streams, plug-ins, lazy imports.

Nothing here knows of messages.
"""
