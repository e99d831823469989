"""Commands that ask about a body."""
