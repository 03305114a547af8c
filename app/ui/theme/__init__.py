"""Theme of Studio: design tokens, colours, fonts, icons and the style sheet.

`theme` provides each colour, size and font by the name of its role; `tokens` reads the design tokens from
their file.
"""
