"""Force tracking: controllers, state estimators, the sampled closed loop, and scores of tracking runs."""
