"""A quarter car on a road, whose semi-active damper follows a demand for force."""
