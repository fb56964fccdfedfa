"""What a job stands on: outputs whole or not at all, checkpoints, signals, locks, workers."""
