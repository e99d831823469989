"""Functions of other libraries by their names, answered without sampling."""
