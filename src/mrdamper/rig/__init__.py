"""Virtual test rigs: physics that is never the identified law, so that a fit can be judged against a truth."""
