"""Manual publishing and calling: saved messages, service calls, and the switch that arms both.

Independent of the window.
"""
