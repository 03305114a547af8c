"""Robot descriptions: W3C Thing Models parsed into typed values, and validation of inputs.

`description.parse` is the entry point; `validate` lists the problems of a document.
"""
