"""From a workspace to a program: templates filled with syntax trees, rendered for people and to run."""
