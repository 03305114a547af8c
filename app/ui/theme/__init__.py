"""Theme of Studio: design tokens, colours, fonts, icons and the style sheet.

`theme` provides colours, sizes and fonts by the name of their role; `tokens` loads the design tokens
from their file.
"""
