"""Lines of a text: its encoding, header, blocks of rows, and cells."""
