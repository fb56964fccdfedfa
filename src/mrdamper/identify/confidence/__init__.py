"""What the data do not pin down: the worst direction, profiles, resampling, each in one sentence."""
