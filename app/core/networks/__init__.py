"""Networks shown in addition to the native one: ROS 1, ROS 2, zenoh.

`kinds` describes the kinds of networks and their limits, `source` joins a network in a background
thread, and `networks` holds their state in the session.
"""
