"""Robots: connections, manual actions, motion permission, Stop.

`fleet` has all robots, each a `robot_link.RobotLink`; `stop` proves that they have stopped.
"""
