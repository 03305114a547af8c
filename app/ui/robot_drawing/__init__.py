"""Drawing of virtual robots in their room.

`scene` composes the room, its objects and the robots; `pepper` and `turtle` paint the figures.
"""
