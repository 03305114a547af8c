"""Robots: connections, manual actions, motion permission, Stop.

`fleet` manages all robots, each represented by a `robot_link.RobotLink`; `stop` proves that robots have
stopped.
"""
