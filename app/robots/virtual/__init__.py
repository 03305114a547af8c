"""The virtual robot's room, body, camera and eyes: no messaging in here.

`app.robots.simulated` and `app.robots.turtle` are the drivers that put them on the network.
"""
