"""Robots: their descriptions, and the kit that makes a driver from functions."""
