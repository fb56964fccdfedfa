"""Calibration by a measured heating curve, and intervals of predicted temperatures."""
