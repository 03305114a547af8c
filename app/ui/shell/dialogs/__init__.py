"""What opens over the window: palette, settings, shortcuts and questions; Stop stays free."""
