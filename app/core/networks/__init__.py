"""Networks beside the native one that a person chose to look at: ROS 1, ROS 2, zenoh.

`kinds` says which there are and what can't be known there, `source` joins one in a thread of
its own, `networks` is what the session knows of them.
"""
