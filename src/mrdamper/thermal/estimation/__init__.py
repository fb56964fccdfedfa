"""What measured temperatures tell: calibration, uncertainty, prediction, observers."""
