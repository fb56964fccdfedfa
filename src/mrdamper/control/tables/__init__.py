"""Tables of a controller, made from a card."""
