"""What ``[sweep]`` makes of one config: its members, each with exact values."""
