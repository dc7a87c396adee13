"""What a person types and reads: options, answers and refusals."""
