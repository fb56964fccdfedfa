"""Tables of the damper model for controllers, made from a model card."""
