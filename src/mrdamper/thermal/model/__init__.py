"""Heat models of a damper: network, reduced and finite-element, with their time stepping."""
