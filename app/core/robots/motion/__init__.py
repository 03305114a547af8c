"""Motion of real robots: the question to the user, the gate for messages, and commands of bridges.

`app.core.robots.stop` stops robots and proves that they stand still.
"""
