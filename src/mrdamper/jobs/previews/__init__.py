"""Previews for the web pages: cards, runs, plot data, quick heating curves, and available choices."""
