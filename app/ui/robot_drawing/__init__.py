"""Drawing of a virtual robot in its room from its state.

`scene` composes the room, its objects and the robot: `pepper` or `turtle`.
"""
