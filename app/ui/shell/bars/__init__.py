"""The bars of the window, and what shows above or below them: banner and toast."""
