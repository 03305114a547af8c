"""Input controls of a form, one module per kind of parameter; `chooser` selects the control.

`base` has the interface that the form uses.
"""
