"""The errors that a run announces: from neighbours of its motion, or from its closed form."""
