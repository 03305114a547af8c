"""Theme of Studio: tokens, colours, fonts, icons and the style sheet.

`theme` provides each colour, size and font by the name of its role; `tokens` reads them from the design's
file.
"""
