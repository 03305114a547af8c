"""The controls of a form: one module for each kind of parameter; `chooser` takes the one that fits.

`base` is what each of them promises to the form.
"""
