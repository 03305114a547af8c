"""Input controls for the parameters of an action, one module per kind of parameter.

`chooser` selects the control for a parameter; `base` contains the interface between form and control.
"""
