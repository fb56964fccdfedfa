"""Jobs on heat: how hot a damper gets, which sink, and what a record tells of it."""
