"""Full turns of angles between samples, counted along the motion."""
