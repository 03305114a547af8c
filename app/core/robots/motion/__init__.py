"""Permission to move real robots: confirmation, the gate for messages, and commands of bridges.

`app.core.robots.stop` stops robots and proves that they stand still.
"""
