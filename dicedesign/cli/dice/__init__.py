"""Commands that make dice."""
