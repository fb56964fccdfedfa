"""Previews for pages: cards, runs, series, quick heating curves, and available choices."""
