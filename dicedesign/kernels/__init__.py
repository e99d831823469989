"""The inner loops in C++, and the one module that knows whether they were built."""
