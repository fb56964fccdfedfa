"""What jobs on cards found: errors on runs, two cards compared, what to cite."""
