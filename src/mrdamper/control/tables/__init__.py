"""Tables that a controller steps on, made from a card."""
