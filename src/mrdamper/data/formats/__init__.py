"""File formats of rigs, one module for each family; ``data.tables`` chooses among them."""
