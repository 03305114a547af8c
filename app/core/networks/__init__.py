"""Networks other than the native one that the user chose to show: ROS 1, ROS 2, zenoh.

`kinds` describes them and the limits of each, `source` joins one in a thread of its own, `networks` is
their state in the session.
"""
