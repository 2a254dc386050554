"""What a user asks for, one workflow per file: run, resume, verify, plan, tradeoff, export."""
