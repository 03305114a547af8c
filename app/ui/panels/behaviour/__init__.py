"""Behaviour: the block editor, its tabs, and the program that its blocks make."""

from app.ui.panels.behaviour.panel import PANEL as PANEL
