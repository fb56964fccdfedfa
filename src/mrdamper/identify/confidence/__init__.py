"""Confidence in fitted parameters: the worst direction, profiles, resampling, each in one sentence."""
