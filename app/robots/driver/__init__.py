"""The driver of a robot: declared as a Python class, its topics, tasks, stop and watchdog, its process.

What drivers may use of it is exported by `app.robots.kit`; `tasks` decides which action runs, waits or ends.
"""
