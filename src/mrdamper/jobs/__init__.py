"""The jobs of the program. Each job is one module that converts inputs and options to a result."""
