"""Robots: descriptions, and the driver kit, which creates a driver from a Python class.

Drivers import `app.robots.kit`. Studio's own robots are one module each: `simulated` (Pepper), `turtle`
(two-wheeled robot), and `rize` (robots that only support RIZE's dialect).
"""
