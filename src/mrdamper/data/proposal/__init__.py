"""What a reader proposes and asks: folders, roles of columns, runs in a table, questions and answers."""
