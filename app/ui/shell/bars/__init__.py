"""The bars of the window, and what shows above or below them: banner and toast.

A bar shows what it is given, and its buttons trigger the commands' actions.
"""
