"""Driver of a robot that is declared as a Python class: topics, tasks, stop, watchdog and process.

`app.robots.kit` exports the public part; `tasks` decides which action runs, waits or ends.
"""
