"""Controls of a form, one module per kind of parameter; `chooser` selects the control.

`base` has the interface used by the form.
"""
