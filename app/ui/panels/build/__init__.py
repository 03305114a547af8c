"""Panels to build programs from blocks."""
