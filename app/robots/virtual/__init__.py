"""Simulation of virtual robots: room, body, camera and object detection.

`app.robots.simulated` and `app.robots.turtle` are the drivers that connect the robots to the network.
"""
