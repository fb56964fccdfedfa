"""Reports of jobs on cards: errors on runs, comparison of two cards."""
