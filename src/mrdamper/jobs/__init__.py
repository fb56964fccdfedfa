"""Jobs: the tasks of the program, such as ``fit`` and ``heat``, one module each."""
