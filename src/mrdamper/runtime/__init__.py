"""Services for running jobs: atomic output files, interrupts, locks, progress, and pools of processes."""
