"""Robots: connections, manual actions, motion permission, and Stop.

`fleet` manages all robots, each represented by a `robot_link.RobotLink`. `stop` ensures and proves that
robots stand still.
"""
