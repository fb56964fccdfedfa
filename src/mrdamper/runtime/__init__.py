"""Atomic outputs, interrupts, locks, progress and pools of processes."""
