"""Words in files and names: headers of columns, and values in titles and file names."""
