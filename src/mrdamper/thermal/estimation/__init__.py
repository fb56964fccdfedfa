"""Calibration of a geometry with a measured heating curve, and intervals of predicted temperatures."""
