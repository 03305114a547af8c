"""Robots: descriptions, and the driver kit, which creates a driver from a Python class.

Drivers import `app.robots.kit`. Studio's own robots are one module each: `simulated` (Pepper) and `turtle`
(two-wheeled robot). `client` is for programs that command robots.
"""
