"""Words in files and names: headers of columns, and values that are written in titles and file names."""
