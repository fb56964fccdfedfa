"""Virtual test rigs: physics that is never the identified law, so that a fit is judged against a truth."""
