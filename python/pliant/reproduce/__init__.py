"""Published figures, each by one command: pliant-reproduce."""
