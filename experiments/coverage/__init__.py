"""Are announced errors true? Families of random scenes, what is true of them, and the book that is kept."""
