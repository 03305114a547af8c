"""Robots: who is there, what a person tries with them, whether they may move, their stop.

`fleet` has all robots, each a `robot_link.RobotLink`; `stop` proves that they stand still.
"""
