"""Force tracking: controllers, estimators, the sampled loop and its scores."""
