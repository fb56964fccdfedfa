"""What pages show before a job: cards, runs, series, quick heating curves, and what can be chosen."""
