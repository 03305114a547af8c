"""Simulation of virtual robots: room, body, camera and object detection, without messaging.

`app.robots.simulated` and `app.robots.turtle` are the drivers that connect them to the network.
"""
