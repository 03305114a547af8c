"""What a robot can do and tell: its W3C Thing Model, parsed once into typed values, and inputs checked.

`description.parse` is the way in, `validate` the sentences about what is wrong with a document.
"""
