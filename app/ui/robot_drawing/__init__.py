"""Drawing of virtual robots in their room.

`scene` paints the room with its objects and robots; `pepper` and `turtle` paint the robots.
"""
