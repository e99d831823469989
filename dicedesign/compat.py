"""Functions of other libraries with the same names and returned values, answered without sampling."""
