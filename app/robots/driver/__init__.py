"""The driver of a robot: declared as a Python class, its topics, tasks, stop and watchdog, its process."""
