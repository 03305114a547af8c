"""Drawing of virtual robots in their room.

`scene` paints the room with its objects and robots; a plug-in for each kind of robot (`figure`) paints it.
"""
