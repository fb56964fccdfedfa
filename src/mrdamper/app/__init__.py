"""The jobs end to end, their reports, and the command line."""
