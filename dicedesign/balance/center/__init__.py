"""The center of mass that serves a goal best, of a body whose hull is given."""
