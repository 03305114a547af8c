"""The look of Studio: tokens, colours, fonts, icons and the style sheet."""
