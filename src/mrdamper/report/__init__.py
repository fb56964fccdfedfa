"""Results as pages, figures, terminal tables, JSON and CSV."""
