"""A virtual robot in its room, painted from its state.

`scene` puts together the room, its objects and the robot: `pepper` or `turtle`.
"""
