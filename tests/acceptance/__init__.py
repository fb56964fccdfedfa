"""Tests of complete tasks with measured runs: fitting, prediction and force tracking."""
