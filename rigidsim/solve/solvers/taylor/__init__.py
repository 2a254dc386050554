"""Taylor series of natural steps, by heyoka: the method of every config that names no other."""
