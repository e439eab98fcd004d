"""What one looks at: maps, plans, curves, figures of the book, drawn from records."""
