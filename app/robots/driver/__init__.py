"""Driver of a robot: declared as a Python class; its topics, tasks, stop, watchdog and process.

`app.robots.kit` exports the public part; `tasks` decides which action runs, waits or ends.
"""
