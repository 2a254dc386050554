"""What a user asks for, one story a file: run, resume, verify, plan, tradeoff, export."""
