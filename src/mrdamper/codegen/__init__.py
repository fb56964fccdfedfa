"""What leaves for a target: C source, FMU and force map, made from a card and proved before they leave."""
