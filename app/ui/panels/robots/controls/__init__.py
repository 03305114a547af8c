"""The controls of a form: one module for each kind of parameter; `chooser` takes the one that fits."""
